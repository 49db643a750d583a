"""Studies: what the run of a scenario needs to know of its system."""

from collections.abc import Callable
from dataclasses import dataclass, field
import importlib
import math
from typing import Any

from pydrake.systems.analysis import SimulatorConfig

from diagrams.common.scenario import Scenario, ScenarioError, nearest

STUDIES = {
    "gauze": "diagrams.gauze.study",
    "navigation": "diagrams.navigation.study",
    "wrist": "diagrams.wrist.study",
    "snake": "diagrams.snake.study",
    "resection": "diagrams.resection.study",
}
"""A scenario's `system` and the module whose `STUDY` runs it."""


def cenic(longest_step: float = 0.01) -> SimulatorConfig:
    """CENIC, which steps all continuous plants; its longest step in s.

    Commands come more often than its error control would ask for: ten times the
    accuracy changes no figure in its first five digits.
    """
    return SimulatorConfig(
        integration_scheme="cenic", accuracy=1e-2, max_step_size=longest_step
    )


@dataclass(frozen=True)
class View:
    """Where the replay looks from: points in the world frame [m]."""

    camera: tuple[float, float, float] = (1.0, -1.0, 0.7)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Study:
    """One system that scenarios can run.

    Attributes:
        name: Its key in `STUDIES`.
        scenario: The scenario's dataclass.
        make_diagram: Makes the diagram of a scenario. Exported vector ports named
            `model.signal` can be logged; an exported port `scene_graph.query`
            is shown in Meshcat.
        check: Raises ScenarioError for a scenario that cannot run.
        measure: The figures of a finished run, flat and in SI units.
        signals: Exported ports to log: port name to column names. A
            one-element port's column is the port's name itself.
        optional: Those of the signals that only some scenarios' diagrams export.
        log_period: Period of the log [s], on the control clock.
        plots: Makes the figures of a run, by file name without ending.
        decorate: Adds trails, arrows and the like to a recording.
        controller: Name of the block whose updates mark a whole control instant
            for `planner_step_median`; empty if there is none.
        required: Dotted keys that a scenario's file must have.
        integrator: Makes the SimulatorConfig of a scenario.
        view: The replay's camera.
        adjust: Called with scenario, diagram and root context before every frame,
            for parameters of the plant that change with time.
        keep: Called with scenario, diagram, root context and whether the run has
            ended, after every frame: saves what must not be lost if it is killed.
        frame_rate: Frames of the replay per second of it [1/s].
        length: How long a scenario really runs [s], at most its duration.
        replay_length: A run longer than this [s] is shown faster.
    """

    name: str
    scenario: type[Scenario]
    make_diagram: Callable[[Any], Any]
    check: Callable[[Any], None]
    measure: Callable[[Any], dict[str, Any]]
    signals: dict[str, tuple[str, ...]]
    log_period: float
    plots: Callable[[Any], dict[str, Any]]
    decorate: Callable[[Any, Any, Any], None] = lambda meshcat, animation, run: None
    controller: str = ""
    optional: frozenset[str] = frozenset()
    adjust: Callable[[Any, Any, Any], None] = lambda scenario, station, context: None
    keep: Callable[[Any, Any, Any, bool], None] = lambda *now: None
    required: tuple[str, ...] = ("system", "duration")
    integrator: Callable[[Any], SimulatorConfig] = lambda scenario: cenic()
    view: View = field(default_factory=View)
    frame_rate: float = 30.0
    length: Callable[[Any], float] = lambda scenario: scenario.duration
    replay_length: float = math.inf


def build(scenario: Any) -> Any:
    """Makes a scenario's diagram.

    Raises:
        ScenarioError: If a block or a plant refuses one of its parameters.
    """
    try:
        return get_study(scenario.system).make_diagram(scenario)
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(str(error)) from error


def get_study(name: Any) -> Study:
    """The study of a name.

    Raises:
        ScenarioError: If there is none; the nearest name is in the message.
    """
    if name not in STUDIES:
        raise ScenarioError(f"system={name!r}: {nearest(str(name), STUDIES)}")
    return importlib.import_module(STUDIES[name]).STUDY
