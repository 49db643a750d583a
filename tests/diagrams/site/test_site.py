"""The site: it builds without a warning, and its links lead somewhere."""

from pathlib import Path
import re

import pytest

from diagrams.site import build
from diagrams.site.docstrings import listed, meaning


def test_links_to_folders_lead_to_their_pages():
    taken = set(build.pages())
    page = Path("diagrams/gauze/README.md")
    text = "[a](../wrist/) [b](inside.md#x) [c](replay.jpg) [d](../../README.md)"
    assert build.relinked(text, page, taken) == (
        "[a](../wrist/README.md) [b](inside.md#x) [c](replay.jpg) "
        "[d](../../overview.md)"
    )
    far = "[e](https://drake.mit.edu) [f](study.py) [g](no.md)"
    assert build.relinked(far, page, taken) == (
        "[e](https://drake.mit.edu) [f](#) [g](no.md)"
    )


def test_names_of_files_lead_to_their_docstrings():
    page, rooms = Path("diagrams/live/README.md"), [Path("diagrams/live")]
    told = "| `session.py: Hand` | `test_session.py: test` |\n```\n`session.py`\n```\n"
    there = "../../reference/diagrams.live.md#diagrams.live.session"
    assert build.referred(told, page, rooms) == told.replace(
        "`session.py: Hand`", f"[`session.py: Hand`]({there})"
    )


FEW = [Path("diagrams/live"), Path("plants/turtlebot"), Path("systems/motion")]
"""A room of each floor: what the reference has of it, in the quick site."""
ALL = [room for floor in build.FLOORS for room in build.rooms_of(floor)]
NOTEBOOKS = sorted((build.ROOT / "notebooks").glob("*.ipynb"))


@pytest.fixture(
    scope="module", params=["part", pytest.param("whole", marks=pytest.mark.study)]
)
def site(request, tmp_path_factory):
    """Its folder, the rooms in its reference, and its notebooks.

    The quick one has every page, but docstrings of a few rooms and one notebook:
    `make docs` builds the whole, as strictly.
    """
    is_whole = request.param == "whole"
    rooms, notebooks = (ALL, NOTEBOOKS) if is_whole else (FEW, NOTEBOOKS[:1])
    left_out = {n.relative_to(build.ROOT) for n in NOTEBOOKS} - {
        n.relative_to(build.ROOT) for n in notebooks
    }
    pages = [page for page in build.pages() if page not in left_out]
    folder = tmp_path_factory.mktemp("site")
    run = folder / "runs" / "some_run"
    run.mkdir(parents=True)
    (run / "replay.html").write_text("<p>moves</p>")
    (run / "metrics.json").write_text("{}")
    picture = build.ROOT / "diagrams" / "navigation" / "ways.png"
    (run / "way_there.png").write_bytes(picture.read_bytes())
    with pytest.MonkeyPatch.context() as patch:
        # Ruff would be started for each of 3,000 signatures, to lay it out.
        rendering = "mkdocstrings_handlers.python._internal.rendering"
        patch.setattr(f"{rendering}._get_ruff_formatter", lambda: None)
        # And what can be searched for is a fifth of what is left.
        search = "material.plugins.search.plugin.SearchPlugin.on_page_context"
        patch.setattr(search, lambda *told, **more: None)
        patch.setattr(build, "pages", lambda: iter(pages))
        front = build.build_site(folder / "out", [run], rooms=rooms)
    return front.parent, rooms, notebooks


def test_it_builds_without_a_warning(site):
    """Every room is there, and what a page shows is, too."""
    site, rooms, notebooks = site
    front = (site / "index.html").read_text()
    assert '<iframe src="gallery/some_run/replay.html"' in front
    for room in ALL:
        assert (site / room / "index.html").exists()
    for room in rooms:
        assert (site / "reference" / ".".join(room.parts) / "index.html").exists()
    for notebook in notebooks:
        assert (site / "notebooks" / notebook.stem / "index.html").exists()
    gallery = (site / "gallery" / "index.html").read_text()
    assert "some_run/way_there.png" in gallery and "some_run/replay.html" in gallery
    assert (site / "gallery" / "some_run" / "replay.html").exists()


def test_nothing_is_fetched_from_elsewhere(site):
    """But by notebooks, whose pages have their own scripts."""
    site = site[0]
    for page in ("index.html", "systems/motion/index.html"):
        fetched = r'<(?:script|link|img)[^>]+(?:src|href)="https?:'
        assert not re.findall(fetched, (site / page).read_text())


def test_the_reference_has_ports_and_units(site):
    text = (site[0] / "reference" / "systems.motion" / "index.html").read_text()
    assert re.search(r"<li>\s*(<p>)?Port <code>tool</code> accepts", text)
    assert "greatest speed of the tip [m/s]" in text


def test_a_dead_link_is_an_error(tmp_path, monkeypatch):
    every = sorted(build.pages())
    few = [p for p in every if p.suffix == ".md" and p.parts[0] not in build.FLOORS]
    own = [p for p in every if p.is_relative_to(build.OWN)]
    monkeypatch.setattr(build, "FLOORS", {})
    monkeypatch.setattr(build, "pages", lambda: [*few, *own])
    monkeypatch.setattr(build, "relinked", lambda text, *rest: text + "\n[x](no.md)\n")
    with pytest.raises(build.SiteError, match=r"no\.md"):
        build.build_site(tmp_path / "out", rooms=[])


def test_what_is_not_its_own_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(build.SiteError, match="expected a new folder"):
        build.build_site(tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    with pytest.raises(build.SiteError, match=r"none: expected results of a run"):
        build.write_gallery(tmp_path, [tmp_path / "none"])


def test_ports_are_a_list_and_parameters_have_a_meaning():
    text = "A block.\n\nPort ``a`` accepts x\nand y.\nPort ``b`` emits z.\n\nEnd."
    assert listed(text) == (
        "A block.\n\n\n- Port ``a`` accepts x\n  and y.\n- Port ``b`` emits z.\n\nEnd."
    )
    assert meaning("parameter(0.5, 'of it', 'm', least=0)") == "of it [m]"
    assert meaning("parameter('a', 'which', choices=KINDS)") == "which"
    assert meaning("3") == "" and meaning("part(Params)") == ""
