"""The pages: every room has one, and what they name is there."""

from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("systems", "plants", "diagrams")
ROOMS = [
    *(init.parent for floor in FLOORS for init in ROOT.glob(f"{floor}/*/__init__.py")),
    ROOT / "notebooks",
]
PAGES = [
    *ROOT.glob("*.md"),
    *(
        page
        for top in (*FLOORS, "notebooks", "tests")
        for page in ROOT.glob(f"{top}/**/*.md")
    ),
]


def short(path: Path) -> str:
    """A path as the project's own."""
    return str(path.relative_to(ROOT))


each_page = pytest.mark.parametrize("page", sorted(PAGES), ids=short)


@pytest.mark.parametrize("room", sorted(ROOMS), ids=short)
def test_every_room_has_a_page_of_its_size(room):
    lines = (room / "README.md").read_text().splitlines()
    assert lines[0].startswith("# ")
    assert len(lines) <= 60


def test_the_front_page_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


@each_page
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text()):
        assert "://" in link or (page.parent / link).exists(), link


@each_page
def test_files_and_functions_that_a_page_names_are_there(page):
    """`file.py` or `file.py: name, name`, from the room, its tests or the root."""
    folder = page.parent.relative_to(ROOT)
    for path, names in re.findall(r"`([\w/]+\.py)(?::([^`]*))?`", page.read_text()):
        places = [ROOT / start / path for start in (folder, "tests" / folder, ".")]
        texts = [place.read_text() for place in places if place.is_file()]
        assert texts, path
        for name in re.findall(r"\w+", names):
            declared = rf"(?m)^\s*(?:(?:def|class|type) {name}\b|{name}\b[^=\n]*=)"
            assert any(re.search(declared, text) for text in texts), f"{path}: {name}"


@each_page
def test_what_a_page_imports_can_be_imported(page):
    for code in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        exec("\n".join(re.findall(r"(?m)^(?:from|import) .*", code)), {})
