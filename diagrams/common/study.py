"""Studies: what the run of a scenario needs to know of its system."""

from collections.abc import Callable
from dataclasses import dataclass, field
import math
from typing import Any

from pydrake.systems.analysis import SimulatorConfig

from diagrams.common.case import Case
from diagrams.common.live import Live
from diagrams.common.progress import Progress
from diagrams.common.scenario import Scenario


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

    What is planned or simulated for a run is done before it, by `prepare` and as
    `companions`: all the rest is handed the case, or a run that has it.

    Attributes:
        name: What scenarios call it, their `system`.
        scenario: The scenario's dataclass.
        make_diagram: Makes the diagram of a case. Exported vector ports named
            `model.signal` can be logged; an exported port `scene_graph.query`
            is shown in Meshcat.
        measure: The figures of a finished run, flat and in SI units.
        signals: Exported ports to log for a scenario, and their signals.
        log_period: Period of the log [s], on the control clock.
        plots: Makes the figures of a run, by file name without ending.
        decorate: Adds trails, arrows and the like to a recording.
        controller: Name of the block whose updates mark a whole control instant
            for `planner_step_median`; empty if there is none.
        required: Dotted keys that a scenario's file must have.
        integrator: Makes the SimulatorConfig of a scenario.
        view: The replay's camera.
        close_up: That of a second replay, `close_up.html`; none if None.
        adjust: Called with case, diagram and root context before every frame,
            for parameters of the plant that change with time.
        keep: Called with case, diagram, root context and whether the run has
            ended, after every frame: saves what must not be lost if it is killed.
        ending: Makes, for case and diagram, what says after every frame from the root
            context whether the run is over before its time.
        frame_rate: Frames of the replay per second of it [1/s].
        length: How long a case really runs [s], at most its scenario's duration.
        replay_length: A run longer than this [s] is shown faster.
        prepare: Makes the case of a scenario, and shows the progress of it.
        outline: Makes a case that is not prepared: its diagram has the same blocks
            and wires, and is there at once.
        gather: Puts plain data of a scenario into the form of its dataclass, in place.
        companions: Scenarios to run beside one, by name; those have none.
        can_film: Raises ScenarioError where `film` cannot work; None without a camera.
        film: Writes the film of a run into its results.
        live: How it is run live; None if it is not.
    """

    name: str
    scenario: type[Scenario]
    make_diagram: Callable[[Any], Any]
    measure: Callable[[Any], dict[str, Any]]
    signals: Callable[[Any], dict[str, Any]]
    log_period: float
    plots: Callable[[Any], dict[str, Any]]
    decorate: Callable[[Any, Any, Any], None] = lambda meshcat, animation, run: None
    controller: str = ""
    adjust: Callable[[Any, Any, Any], None] = lambda case, station, context: None
    keep: Callable[[Any, Any, Any, bool], None] = lambda *now: None
    ending: Callable[[Any, Any], Callable[[Any], bool]] = lambda case, station: (
        lambda context: False
    )
    required: tuple[str, ...] = ("system", "duration")
    integrator: Callable[[Any], SimulatorConfig] = lambda scenario: cenic()
    view: View = field(default_factory=View)
    close_up: View | None = None
    frame_rate: float = 30.0
    length: Callable[[Any], float] = lambda case: case.scenario.duration
    replay_length: float = math.inf
    prepare: Callable[[Any, Progress], Case] = lambda scenario, progress: Case(scenario)
    outline: Callable[[Any], Case] = Case
    gather: Callable[[dict[str, Any]], None] = lambda tree: None
    companions: Callable[[Any], dict[str, Any]] = lambda scenario: {}
    can_film: Callable[[], None] | None = None
    film: Callable[[Any, Any], None] = lambda run, into: None
    live: Live | None = None
