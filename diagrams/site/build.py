"""Builds the site: `python -m diagrams.site.build DIR` (`make docs`).

MkDocs makes it, with the theme Material, mkdocstrings and mkdocs-jupyter. What is done
here is only what they do not know: which files are pages, that a link to a folder means
the page in it, and which runs are shown.
"""

import argparse
from collections.abc import Iterator, Sequence
import logging
import os
from pathlib import Path
import re
import shutil
import sys
from typing import Any

from diagrams.common.scenario import ScenarioError, extra

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
FLOORS = {
    "diagrams": "What runs",
    "systems": "What decides",
    "plants": "What obeys",
}
_LINK = re.compile(r"(\]\()([^)#\s:]+)((?:#[^)]*)?\))")
_CODE = re.compile(r"(?<!\[)`([\w/]+\.py)(?:: [^`]+)?`")
OVERVIEW = "overview.md"
"""The project's front page; the site has one of its own."""
OWN = Path("diagrams/site/pages")
"""What is written for the site alone."""


MARK = ".site"
"""File in a folder that was made here, and may be made anew."""


class SiteError(RuntimeError):
    """What MkDocs had to say, or what is wrong with what was asked."""


class Said(logging.Handler):
    """Keeps what is logged."""

    def __init__(self, level: int) -> None:
        """Keeps what is at least of a level."""
        super().__init__(level)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps a line."""
        self.lines.append(record.getMessage())


def pages() -> Iterator[Path]:
    """The pages, pictures and notebooks, relative to the project's folder."""
    for kind in ("md", "ipynb", "jpg", "png", "css"):
        yield from (p.relative_to(ROOT) for p in ROOT.glob(f"*.{kind}"))
        for top in (*FLOORS, "notebooks"):
            yield from (p.relative_to(ROOT) for p in (ROOT / top).rglob(f"*.{kind}"))


def place(page: Path) -> Path:
    """Where a page of the project is on the site."""
    if page.is_relative_to(OWN):
        return page.relative_to(OWN)
    return Path(OVERVIEW) if page == Path("README.md") else page


def relinked(text: str, page: Path, taken: set[Path]) -> str:
    """A page's text with links that lead somewhere on the site.

    A link to a folder means its page; one to a file that is no page leads nowhere.

    Args:
        text: Of the page.
        page: Where it lies, relative to the project's folder.
        taken: All pages.
    """

    def link(match: re.Match[str]) -> str:
        target = Path(os.path.normpath(page.parent / match[2]))
        for there in (target, target / "README.md"):
            if there in taken:
                way = os.path.relpath(place(there), place(page).parent)
                return f"{match[1]}{way}{match[3]}"
        if not (ROOT / target).exists():
            return match[0]  # a dead link: MkDocs says so
        return f"{match[1]}#{match[3]}"  # of the source

    return _LINK.sub(link, text)


def referred(text: str, page: Path, rooms: Sequence[Path]) -> str:
    """A page's text whose `file.py: name` lead to the file's docstrings.

    Args:
        text: Of the page.
        page: Where it lies, relative to the project's folder.
        rooms: That are in the reference.
    """

    def link(match: re.Match[str]) -> str:
        for file in (page.parent / match[1], Path(match[1])):
            room = Path(*file.parts[:2])
            if room in rooms and (ROOT / file).exists():
                there = f"reference/{'.'.join(room.parts)}.md"
                way = os.path.relpath(there, place(page).parent)
                return f"[{match[0]}]({way}#{'.'.join(file.with_suffix('').parts)})"
        return match[0]

    parts = text.split("```")
    parts[::2] = [_CODE.sub(link, part) for part in parts[::2]]
    return "```".join(parts)


def copy_pages(folder: Path, rooms: Sequence[Path]) -> None:
    """Copies all pages into a folder, links made good.

    Args:
        folder: To copy to.
        rooms: That are in the reference.
    """
    taken = set(pages())
    for page in sorted(taken):
        there = folder / place(page)
        there.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix == ".md":
            text = (ROOT / page).read_text()
            there.write_text(referred(relinked(text, page, taken), page, rooms))
        else:
            shutil.copyfile(ROOT / page, there)


def write_reference(folder: Path, rooms: Sequence[Path]) -> None:
    """Writes a page for every room, of its modules' docstrings."""
    for room in rooms:
        name = ".".join(room.parts)
        modules = sorted((ROOT / room).rglob("*.py"))
        names = [".".join(m.relative_to(ROOT).with_suffix("").parts) for m in modules]
        told = [f"::: {one}\n" for one in names if not one.endswith("__init__")]
        (folder / f"{name}.md").write_text("\n".join([f"# {name}\n", *told]))


def write_gallery(folder: Path, runs: Sequence[Path]) -> str:
    """Copies the replays and pictures of runs; the page that shows them.

    Args:
        folder: Of the gallery.
        runs: Folders of results.

    Returns:
        The first replay, to be shown on the front page; "" without one.

    Raises:
        SiteError: If one is no folder of results.
    """
    lines, first = ["# Gallery\n", "Replays are one file each: open, turn, play.\n"], ""
    for run in runs:
        if not (run / "metrics.json").exists():
            raise SiteError(f"{run}: expected results of a run, see `trocar run`")
        there = folder / run.name
        there.mkdir(parents=True, exist_ok=True)
        lines.append(f"## {run.name}\n")
        if (run / "replay.html").exists():
            shutil.copyfile(run / "replay.html", there / "replay.html")
            lines.append(f"[Replay]({run.name}/replay.html)\n")
            first = first or f"gallery/{run.name}/replay.html"
        for picture in sorted(run.glob("*.png")):
            shutil.copyfile(picture, there / picture.name)
            title = picture.stem.replace("_", " ")
            lines.append(f"![{title}]({run.name}/{picture.name}){{ loading=lazy }}\n")
    (folder / "index.md").write_text("\n".join(lines))
    return first


def rooms_of(floor: str) -> list[Path]:
    """A floor's rooms, those without a page left out."""
    found = sorted((ROOT / floor).glob("*/README.md"))
    return [page.parent.relative_to(ROOT) for page in found]


def contents(folder: Path, with_reference: bool) -> list[Any]:
    """The site's table of contents, as MkDocs takes it."""

    def title(page: Path) -> str:
        head = (folder / page).read_text().partition("\n")[0]
        return head.removeprefix("# ").partition(":")[0]

    def listed(room: Path) -> dict[str, Any]:
        more = sorted((folder / room).glob("*.md"))
        names = [str(p.relative_to(folder)) for p in more if p.name != "README.md"]
        index = str(room / "README.md")
        return {title(room / "README.md"): [index, *names] if names else index}

    notes = sorted((folder / "notebooks").glob("*.ipynb"))
    nav: list[Any] = [
        {
            "Start": [
                "index.md",
                {"Overview": OVERVIEW},
                {"Coming from elsewhere": "coming_from.md"},
                "PAPERS.md",
            ]
        },
    ]
    for floor, name in FLOORS.items():
        rooms = [room for room in rooms_of(floor) if (folder / room).exists()]
        nav.append({name: [listed(room) for room in rooms]})
    names = [str(p.relative_to(folder)) for p in notes]
    nav.append({"Notebooks": ["notebooks/README.md", *names]})
    if (folder / "gallery").exists():
        nav.append({"Gallery": "gallery/index.md"})
    if with_reference:
        told = sorted((folder / "reference").glob("*.md"))
        nav.append({"Reference": [str(p.relative_to(folder)) for p in told]})
    nav.append({"Contribute": ["CONTRIBUTING.md", "CHANGELOG.md"]})
    return nav


def build_site(
    out: Path,
    runs: Sequence[Path] = (),
    rooms: Sequence[Path] | None = None,
    notebooks: bool = False,
) -> Path:
    """Builds the site; whatever MkDocs has to say is an error.

    Args:
        out: Its folder, made anew.
        runs: Folders of results for the gallery.
        rooms: Whose docstrings are shown; all if None.
        notebooks: Whether they are run for it; else they are shown as they are.

    Returns:
        Its front page.

    Raises:
        ModuleNotFoundError: Without the extra `docs`.
        SiteError: If there was a warning, a dead link for example, or if the folder
            holds something else.
    """
    from mkdocs.commands.build import build
    from mkdocs.config import load_config
    from mkdocs.exceptions import Abort

    pages_, site = out / "pages", out / "site"
    if out.exists() and any(out.iterdir()) and not (out / MARK).exists():
        raise SiteError(f"{out}: expected a new folder, or one of an earlier site")
    shutil.rmtree(out, ignore_errors=True)
    if rooms is None:
        rooms = [room for floor in FLOORS for room in rooms_of(floor)]
    copy_pages(pages_, rooms)
    (out / MARK).touch()
    (pages_ / "reference").mkdir()
    write_reference(pages_ / "reference", rooms)
    first = ""
    if runs:
        (pages_ / "gallery").mkdir()
        first = write_gallery(pages_ / "gallery", runs)
    moving = f'<iframe src="{first}" style="width:100%;height:26em;border:0"></iframe>'
    still = "![The arm brings gauze, round the red tool](diagrams/gauze/replay.jpg)"
    front = pages_ / "index.md"
    text = front.read_text().replace("<!-- moving -->", moving if first else still)
    front.write_text(text)
    os.environ["TROCAR_NOTEBOOKS"] = str(notebooks).lower()
    config = load_config(
        str(HERE / "mkdocs.yml"),
        docs_dir=str(pages_.absolute()),
        site_dir=str(site.absolute()),
        nav=contents(pages_, bool(rooms)),
        strict=True,
    )
    said = Said(logging.WARNING)
    logging.getLogger("mkdocs").addHandler(said)
    config.plugins.run_event("startup", command="build", dirty=False)
    try:
        build(config)
    except Abort as error:
        raise SiteError("\n".join(said.lines)) from error
    finally:
        config.plugins.run_event("shutdown")
        logging.getLogger("mkdocs").removeHandler(said)
    return site / "index.html"


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m diagrams.site.build", description=__doc__
    )
    parser.add_argument("out", type=Path, metavar="DIR", help="of the site, made anew")
    parser.add_argument(
        "--runs",
        nargs="*",
        type=Path,
        default=[],
        metavar="RUN",
        help="folders of results for the gallery",
    )
    parser.add_argument("--notebooks", action="store_true", help="run them for it")
    told = parser.parse_args()
    try:
        with extra("docs"):
            print(build_site(told.out, told.runs, notebooks=told.notebooks))
    except (SiteError, ScenarioError) as error:
        sys.exit(f"the site: {error}")


if __name__ == "__main__":
    main()
