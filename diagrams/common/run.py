"""Running a scenario: prepare, build, advance, log; then measure, plot and replay."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
import gc
import json
import math
from pathlib import Path
from time import perf_counter
from typing import Any
import weakref

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder

from diagrams.common import metrics, replay
from diagrams.common.case import Case
from diagrams.common.log import (
    add_log,
    columns,
    first_fault,
    named,
    read_log,
    save_signals,
)
from diagrams.common.plots import save_figure
from diagrams.common.progress import Progress, Show, progress_of, silent
from diagrams.common.provenance import provenance
from diagrams.common.report import run_page
from diagrams.common.results import Results, results, save_scenario
from diagrams.common.scenario import ScenarioError, refusals
from diagrams.common.study import Study
from diagrams.studies import build, check_scenario, get_study
from systems.common.block import Block
from systems.common.compiled import rehearse
from systems.common.stopwatch import STOPWATCH

INTERRUPTED = "interrupted"
"""Error of a run that was interrupted."""

LOOKS = 8
"""One frame in so many is watched by the stopwatch."""

LARGEST_LOG = 2e9
"""Of a run, in bytes."""


@dataclass
class Run:
    """A run of a case: what was simulated and what was logged.

    Attributes:
        case: What ran.
        study: The system that ran it.
        diagram: The root diagram; the study's own is its subsystem "station". That of
            a scenario is gone when its run is.
        logged: Ports that were logged, and their signals.
        signals: Column name to samples; "time" [s] is the common clock.
        wall_time: Wall seconds of the advance alone.
        simulated: Simulated seconds reached.
        instants: Wall seconds of all blocks, one for every whole control instant.
        updates: Median wall seconds of one update, by block.
        error: Why the run ended early or failed, or "".
        duration: Simulated seconds that the whole run takes.
        replay_speed: Simulated seconds that a second of the replay shows.
        metrics: The figures, once measured.
    """

    case: Case
    study: Study
    diagram: Any
    logged: dict[str, Any] = field(default_factory=dict)
    signals: dict[str, np.ndarray] = field(default_factory=dict)
    wall_time: float = 0.0
    simulated: float = 0.0
    instants: list[float] = field(default_factory=list)
    updates: dict[str, float] = field(default_factory=dict)
    error: str = ""
    duration: float = 0.0
    replay_speed: float = 1.0
    metrics: dict[str, Any] = field(default_factory=dict)

    @property
    def scenario(self) -> Any:
        """What ran, as it was written."""
        return self.case.scenario

    @property
    def is_over(self) -> bool:
        """Whether the whole of it was simulated."""
        return self.simulated >= self.duration > 0.0

    def __getattr__(self, name: str) -> Any:
        """What was logged below a name: `run.planner.guide.rho` is an array (n)."""
        if name.startswith("_"):  # asked for by who copies it
            raise AttributeError(name)
        return named(self.logged, self.signals, name)


@contextmanager
def survived(run: Run, what: str = "") -> Iterator[None]:
    """What fails or is interrupted in this context does not take the run with it.

    Args:
        run: Its `error` says why, if there is none yet.
        what: Is being done, for the message.
    """
    try:
        yield
    except KeyboardInterrupt:
        run.error = run.error or what + INTERRUPTED
    except (Exception, SystemExit) as error:  # Drake ends some errors in SystemExit
        run.error = run.error or f"{what}{type(error).__name__}: {error}"


def start(diagram: Any, config: SimulatorConfig, context: Any = None) -> Simulator:
    """A simulator of a diagram at the start of a run, with the run's integrator."""
    simulator = Simulator(diagram, context)
    ApplySimulatorConfig(config, simulator)
    return simulator


def prepare(scenario: Any, progress: Progress = silent) -> Case:
    """Does all that must be done before a scenario runs: its plan, its companions.

    Args:
        scenario: A study's scenario.
        progress: Shows how far it is, e.g. `progress_bar`.

    Raises:
        ScenarioError: If the scenario, or one beside it, cannot run.
    """
    check_scenario(scenario)
    study = get_study(scenario.system)
    with refusals():
        case = study.prepare(scenario, progress)
    check_log(study.signals(scenario), study.length(case), study.log_period)
    for name, other in study.companions(scenario).items():
        beside = simulate(other, progress=progress_of(name, progress))
        if beside.error.endswith(INTERRUPTED):
            raise KeyboardInterrupt
        case.companions[name] = beside
    return case


def simulate(
    scenario: Any,
    meshcat: Any = None,
    progress: Progress = silent,
) -> Run:
    """Runs a scenario and returns its log; raises nothing that a run can survive.

    An error or an interruption in mid-run ends it; what was logged until then
    is kept and `Run.error` says why.

    Args:
        scenario: A study's scenario, or a case of one (see `prepare`).
        meshcat: Records into this Meshcat if given. Frames are drawn between the
            timed advances, so that they do not count as simulation time.
        progress: Shows how far it is, e.g. `progress_bar`.

    Raises:
        ScenarioError: If the scenario cannot run.
    """
    case = scenario if isinstance(scenario, Case) else prepare(scenario, progress)
    return owned(simulate_diagram(case, build(case), meshcat, progress))


def owned(run: Run) -> Run:
    """The run; when it is dropped its diagram, which nobody else has, goes with it.

    Without that a run stays in memory for ever: see `Block`.
    """
    weakref.finalize(run, let_go, [*blocks_of(run.diagram)]).atexit = False
    return run


def blocks_of(diagram: Any) -> Iterator[Block]:
    """All Python blocks in a diagram and in the diagrams within it."""
    for system in diagram.GetSystems():
        if isinstance(system, Block):
            yield system
        if hasattr(system, "GetSystems"):
            yield from blocks_of(system)


def let_go(blocks: list[Block]) -> None:
    """Lets blocks go that will not be asked again."""
    for block in blocks:
        block.let_go()


def simulate_diagram(
    scenario: Any,
    diagram: Any,
    meshcat: Any = None,
    progress: Progress = silent,
    save: Callable[[Run], None] = lambda run: None,
) -> Run:
    """Runs a diagram of one's own making, for example with swapped blocks.

    Args:
        scenario: The scenario that it was made for, or a case of it.
        diagram: Exports the ports that the scenario's study logs.
        meshcat: As for `simulate`.
        progress: As for `simulate`.
        save: Called once there is all that was logged, before it is measured.
    """
    case = scenario if isinstance(scenario, Case) else prepare(scenario, progress)
    study = get_study(case.scenario.system)
    builder = DiagramBuilder()
    station = builder.AddNamedSystem("station", diagram)
    logged = study.signals(case.scenario)
    duration = study.length(case)
    sink = add_log(builder, station, logged, study.log_period)
    speed = replay_speed(study, duration)
    recorder = replay.add_recorder(builder, station, meshcat, study, speed)
    root = builder.Build()
    config = study.integrator(case.scenario)
    simulator = start(root, config)
    context = simulator.get_mutable_context()
    root.SetRandomContext(context, RandomGenerator(case.scenario.seed))
    run = Run(case, study, root, logged, duration=duration, replay_speed=speed)
    first = start(root, config, context.Clone())
    rehearse(lambda: first.AdvanceTo(1.5 * study.log_period))
    STOPWATCH.reset()
    gc.disable()  # nothing in a run makes cycles, and the collector costs 5 %
    try:
        with survived(run), progress("running", "simulated s") as show:
            advance(run, simulator, recorder, show)
    finally:
        gc.enable()
    run.simulated = context.get_time()
    with survived(run, "what was done could not be saved: "):
        study.keep(case, station, context, True)
    run.signals = read_log(sink, logged, context)
    run.instants = STOPWATCH.whole_instants(study.controller)
    run.updates = STOPWATCH.per_block()
    run.error = run.error or first_fault(run.signals)
    with survived(run, "signals could not be saved: "):
        save(run)
    if len(run.signals["time"]) > 1:
        with survived(run, "figures could not be measured: "):
            run.metrics = study.measure(run)
        run.metrics = metrics.common(run) | run.metrics
    with survived(run, "replay could not be drawn: "):
        recorder.finish(run)
    return run


def check_log(logged: Mapping[str, Any], duration: float, period: float) -> None:
    """Refuses a run whose log would not fit into memory, before it is asked for.

    Raises:
        ScenarioError: The longest duration that fits is named.
    """
    width = 1 + sum(len(columns(port, kind)) for port, kind in logged.items())
    longest = LARGEST_LOG / (8 * width) * period
    if duration > longest:
        raise ScenarioError(
            f"duration={duration:.6g} s: expected <= {longest:.6g}; the log of {width} "
            f"columns every {period:.3g} s takes {LARGEST_LOG / 1e9:.3g} GB then"
        )


def replay_speed(study: Study, duration: float) -> float:
    """How much faster than the run [s] its replay is.

    Frames of a run that is shown faster fall on instants of the log, which lie on
    the control clock: stopping between those would shorten the integrator's steps.
    """
    if duration <= study.replay_length:
        return 1.0
    interval = duration / study.replay_length / study.frame_rate
    return math.ceil(interval / study.log_period) * study.log_period * study.frame_rate


def advance(
    run: Run,
    simulator: Any,
    recorder: replay.Recorder,
    show: Show,
) -> None:
    """Steps the simulator from frame to frame; only the steps are timed."""
    duration, period = run.duration, run.replay_speed / run.study.frame_rate
    every = replay.thinned(math.ceil(duration / period))
    simulator.Initialize()
    recorder.draw(simulator.get_context())
    station = run.diagram.GetSubsystemByName("station")
    is_over = run.study.ending(run.case, station)
    time, frame = 0.0, 0
    while time < run.duration:
        STOPWATCH.look(frame % LOOKS == 0, time if frame else -1.0)
        frame += 1
        time = min(frame * period, duration)
        run.study.adjust(run.case, station, simulator.get_mutable_context())
        start = perf_counter()
        simulator.AdvanceTo(time)
        run.wall_time += perf_counter() - start
        if frame % every == 0 or time == duration:
            recorder.draw(simulator.get_context())
        show(time, duration)
        run.study.keep(run.case, station, simulator.get_context(), False)
        if is_over(simulator.get_context()):
            run.duration = time


def run_scenario(
    scenario: Any,
    out: Path,
    with_replay: bool = True,
    progress: Progress = silent,
    with_film: bool = False,
) -> Run:
    """Runs a scenario and writes all its results into a folder.

    Writes `scenario.yaml` with the files that it names, `signals.csv`,
    `metrics.json`, the plots as PNG, `replay.html`, `provenance.json` and
    `report.html`, in this order, so that nothing computed is lost if a later one
    fails. What an earlier run left there stays until this one begins, and then goes.
    Instead of a scenario a case of one is taken, too.

    Raises:
        ScenarioError: If the scenario cannot run, the folder not be written, or
            another run writes to it.
    """
    case = scenario if isinstance(scenario, Case) else None
    scenario = case.scenario if case else scenario
    check_scenario(scenario)
    if with_film:
        can_film = get_study(scenario.system).can_film
        if can_film is None:
            raise ScenarioError(f"--endoscope: {scenario.system} has no endoscope")
        can_film()
    with results(out) as into:
        case = case or prepare(scenario, progress)
        diagram = build(case)
        meshcat = replay.start_meshcat() if with_replay else None
        try:
            save_scenario(scenario, into)
        except OSError as error:
            raise ScenarioError(f"cannot write to {str(out)!r}: {error}") from error

        def save(run: Run) -> None:
            with into.file("signals.csv") as draft:
                save_signals(run.signals, draft)

        run = owned(simulate_diagram(case, diagram, meshcat, progress, save))
        with survived(run, "results could not be saved: "):
            write(run, into)
            if meshcat is not None:
                with into.file("replay.html") as draft:
                    draft.write_text(meshcat.StaticHtml())
                near = run.study.close_up
                if near is not None:
                    meshcat.SetCameraPose(near.camera, near.target)
                    meshcat.SetProperty(f"/{replay.FAR}", "visible", False)
                    with into.file("close_up.html") as draft:
                        draft.write_text(meshcat.StaticHtml())
            if with_film and run.metrics:
                with survived(run, "film could not be rendered: "):
                    run.study.film(run, into)
            write_page(run, into)
    return run


def write(run: Run, into: Results) -> None:
    """Writes a run's figures and plots."""
    with into.file("metrics.json") as draft:
        draft.write_text(json.dumps(run.metrics, indent=2) + "\n")
    figures = {}
    with survived(run, "plots could not be drawn: "):
        figures = run.study.plots(run) if run.metrics else {}
    for name, figure in figures.items():
        with into.file(f"{name}.png") as draft:
            save_figure(figure, draft)


def write_page(run: Run, into: Results) -> None:
    """Writes what made the run, and its page with all that was written before."""
    made_by = provenance()
    with into.file("provenance.json") as draft:
        draft.write_text(json.dumps(made_by, indent=2) + "\n")
    with into.file("report.html") as draft:
        draft.write_text(run_page(run, into.folder, made_by), encoding="utf-8")
