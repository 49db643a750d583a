"""Imports run downwards only, also those within functions and those by a name."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("plants", "systems", "diagrams")


def module_name(file: Path, root: Path) -> str:
    """The dotted name of a file; a package's is that of its folder."""
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(tree: ast.AST, package: str, modules: set[str]) -> set[str]:
    """Modules that a file's text asks for.

    A text that is a module's name counts as an import of it: `importlib` would.
    """
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: 1 - node.level or None] if node.level else []
            base = ".".join([*above, *filter(None, [node.module])])
            names |= {base} | {f"{base}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names |= {node.value} if "." in node.value else set()
    return names & modules


def graph(root: Path, floors: tuple[str, ...] = FLOORS) -> dict[str, set[str]]:
    """Every module, and those that it imports; a package's own file is above it."""
    files = {
        module_name(file, root): file
        for floor in floors
        for file in sorted((root / floor).rglob("*.py"))
    }
    arrows = {}
    for name, file in files.items():
        package = name if file.stem == "__init__" else name.rpartition(".")[0]
        found = imported(ast.parse(file.read_text()), package, set(files))
        # Whatever is imported runs the packages that it lies in first.
        for module in [*found, name]:
            parts = module.split(".")
            found |= {".".join(parts[:n]) for n in range(1, len(parts))}
        # A module needs its own package's file, not the other way round.
        arrows[name] = found & set(files) - {name}
    return arrows


@pytest.fixture(scope="module")
def arrows() -> dict[str, set[str]]:
    return graph(ROOT)


def test_all_modules_are_seen(arrows):
    assert len(arrows) > 150
    assert "diagrams.gauze.study" in arrows["diagrams.studies"]
    assert "diagrams.common.run" in arrows["diagrams.common.cli"]  # in a function


def test_there_are_no_circles(arrows):
    TopologicalSorter(arrows).prepare()  # raises CycleError, which names them


def between(arrows: dict[str, set[str]], low: str, high: str) -> set[str]:
    """Imports of one floor by another."""
    return {
        f"{name} -> {module}"
        for name, modules in arrows.items()
        for module in modules
        if name.startswith(f"{low}.") and module.startswith(f"{high}.")
    }


def test_systems_know_no_diagrams(arrows):
    assert between(arrows, "systems", "diagrams") == set()


def test_plants_know_of_systems_only_what_is_common(arrows):
    assert between(arrows, "plants", "diagrams") == set()
    found = between(arrows, "plants", "systems")
    assert {arrow for arrow in found if " -> systems.common" not in arrow} == set()


def importers(arrows: dict[str, set[str]], *modules: str) -> set[str]:
    """Those of the diagrams that import one of some modules."""
    return {
        name
        for name, found in arrows.items()
        if name.startswith("diagrams.") and found & set(modules)
    }


def test_what_is_done_before_a_run_is_done_nowhere_else(arrows):
    """Metrics, plots, replays and diagrams can neither simulate nor plan."""
    assert importers(arrows, "diagrams.common.run") == {
        "diagrams.campaigns.acts",  # what a run of a campaign does
        "diagrams.common.cli",
        "diagrams.learning.baselines",
        "diagrams.learning.environments",
        "diagrams.live.command",
        "diagrams.live.session",
        "diagrams.resection.operate",  # who chooses while it runs
    }
    assert importers(arrows, "diagrams.studies") == {
        "diagrams.campaigns.acts",
        "diagrams.campaigns.campaign",
        "diagrams.campaigns.report",
        "diagrams.common.cli",
        "diagrams.common.run",
        "diagrams.learning.environments",
        "diagrams.live.command",
        "diagrams.live.session",
        "diagrams.resection.atlas",
        "diagrams.resection.export",
        "diagrams.resection.rehearsal",
    }
    planning = "systems.resection.planning"
    assert importers(
        arrows, f"{planning}.planner", f"{planning}.reach", f"{planning}.access"
    ) == {
        "diagrams.keyhole.access",
        "diagrams.resection.console",
        "diagrams.resection.operation",
        "diagrams.resection.rounds",
        "diagrams.resection.scenario",  # the planner's parameters
    }
    assert importers(arrows, "diagrams.resection.operation") == {
        "diagrams.keyhole.access",
        "diagrams.keyhole.operation",
        "diagrams.resection.console",
        "diagrams.resection.diagram",  # the case's type
        "diagrams.resection.online",
        "diagrams.resection.operate",
        "diagrams.resection.planned",
        "diagrams.resection.rounds",
        "diagrams.resection.study",
        "diagrams.resection.tool_error",
    }


@pytest.mark.parametrize(
    "text",
    [
        "from house import two",
        "from house.two import thing",
        "from . import two",
        "from .two import thing",
        "import house.two",
        "def later():\n    from house.two import thing",
        "TABLE = {'two': 'house.two'}",
        "if TYPE_CHECKING:\n    import house.two as second",
    ],
)
def test_a_circle_is_found(tmp_path, text):
    house = tmp_path / "house"
    house.mkdir()
    (house / "__init__.py").write_text('"""A house."""\n')
    (house / "one.py").write_text(text)
    (house / "two.py").write_text("import house.three\n")
    (house / "three.py").write_text("import math\n")
    TopologicalSorter(graph(tmp_path, ("house",))).prepare()
    (house / "three.py").write_text("from house.one import thing\n")
    with pytest.raises(CycleError):
        TopologicalSorter(graph(tmp_path, ("house",))).prepare()
