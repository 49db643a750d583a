"""The systems that scenarios can run, and scenarios loaded by their names."""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from diagrams.common.case import Case
from diagrams.common.scenario import (
    ScenarioError,
    find_scenario,
    nearest,
    refusals,
)
from diagrams.common.study import Study
from diagrams.common.tree import (
    apply_override,
    fit,
    make,
    put,
    read_tree,
    require,
    settle,
)
from systems.common.parameter import check


class Studies(Mapping[str, Study]):
    """Studies by the systems' names.

    One is imported when it is asked for: all take seconds, and a run needs one.
    """

    def __init__(self, **modules: str) -> None:
        """Makes the map, of the module of each system's `STUDY`."""
        self._modules = modules

    def __getitem__(self, name: str) -> Study:
        """The study of a system."""
        study: Study = import_module(self._modules[name]).STUDY
        return study

    def __iter__(self) -> Iterator[str]:
        """The systems' names."""
        return iter(self._modules)

    def __len__(self) -> int:
        """Number of systems."""
        return len(self._modules)

    def __contains__(self, name: object) -> bool:
        """Whether there is such a system; nothing is imported."""
        return name in self._modules


STUDIES = Studies(
    gauze="diagrams.gauze.study",
    navigation="diagrams.navigation.study",
    wrist="diagrams.wrist.study",
    snake="diagrams.snake.study",
    resection="diagrams.resection.study",
    keyhole="diagrams.keyhole.study",
)
"""A scenario's `system` and the study that runs it."""


def get_study(name: Any) -> Study:
    """The study of a name.

    Raises:
        ScenarioError: If there is none; the nearest name is in the message.
    """
    if not isinstance(name, str) or name not in STUDIES:
        raise ScenarioError(f"system={name!r}: {nearest(str(name), STUDIES)}")
    return STUDIES[name]


def load_scenario(
    name: str,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Any:
    """Loads a scenario by name or file, with overrides, and checks it.

    Args:
        name: A scenario's name (see `scenario_files`) or the path of a file.
        overrides: `KEY.SUB=VALUE` texts, applied in order.
        seed: Replaces the scenario's seed.
        duration: Replaces the scenario's duration [s].

    Returns:
        The study's own scenario dataclass.

    Raises:
        ScenarioError: For anything that can be known to be wrong beforehand.
    """
    path = find_scenario(name)
    return scenario_of(read_tree(path), overrides, seed, duration, path)


def scenario_of(
    tree: dict[str, Any],
    overrides: Sequence[str] | Mapping[str, Any] = (),
    seed: int | None = None,
    duration: float | None = None,
    path: Path = Path("scenario"),
) -> Any:
    """The checked scenario of plain data, which is changed in place.

    Args:
        tree: Plain data, as `read_tree` gives them.
        overrides: As for `load_scenario`, as are seed and duration; or values by key.
        seed: Replaces the scenario's seed.
        duration: Replaces the scenario's duration [s].
        path: Where the data came from: relative names of files begin beside it.

    Raises:
        ScenarioError: For anything that can be known to be wrong beforehand.
    """
    if "system" not in tree:
        raise ScenarioError(f"{path}: missing key 'system', e.g. 'system: gauze'")
    study = get_study(tree["system"])
    schema = study.scenario
    study.gather(tree)
    settle(schema, tree, path.parent)
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            put(tree, key.split("."), value, key)
    else:
        for text in overrides:
            apply_override(tree, text)
    if seed is not None:
        tree["seed"] = seed
    if duration is not None:
        tree["duration"] = duration
    if tree["system"] != study.name:
        raise ScenarioError(
            f"system={tree['system']!r}: expected {study.name!r}, as in {path}"
        )
    study.gather(tree)
    settle(schema, tree, Path.cwd())
    for key in study.required:
        require(tree, key, path)
    scenario = make(schema, fit(schema, tree))
    check_scenario(scenario)
    return scenario


def check_scenario(scenario: Any) -> None:
    """Holds every value against its declaration, then the study's rules."""
    study = get_study(scenario.system)
    if not isinstance(scenario, study.scenario):
        kind = type(scenario).__name__
        raise ScenarioError(f"system={study.name!r}: a {kind} is of another system")
    with refusals():
        check(scenario, "")


def build(case: Any) -> Any:
    """Makes a diagram.

    Args:
        case: A case; or a scenario, which then is not prepared: a plan is empty.

    Raises:
        ScenarioError: If a block or a plant refuses one of its parameters.
    """
    with refusals():
        if isinstance(case, Case):
            return get_study(case.scenario.system).make_diagram(case)
        study = get_study(case.system)
        return study.make_diagram(study.outline(case))
