"""Running a scenario: build, advance, log; then measure, plot and replay."""

from collections.abc import Callable
from dataclasses import dataclass, field
import gc
import json
import math
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Multiplexer

from diagrams.common import metrics, replay
from diagrams.common.plots import save_figure
from diagrams.common.scenario import ScenarioError, check_scenario, save_scenario
from diagrams.common.study import Study, build, get_study
from systems.common.compiled import rehearse
from systems.common.stopwatch import STOPWATCH

Progress = Callable[[float, float], None]
"""Called with simulated seconds: those done and all."""


@dataclass
class Run:
    """A run of a scenario: what was simulated and what was logged.

    Attributes:
        scenario: What ran.
        study: The system that ran it.
        diagram: The root diagram; the study's own is its subsystem "station".
        signals: Column name to samples; "time" [s] is the common clock.
        wall_time: Wall seconds of the advance alone.
        simulated: Simulated seconds reached.
        instants: Wall seconds of all blocks, one for every whole control instant.
        updates: Median wall seconds of one update, by block.
        error: Why the run ended early, or "".
        duration: Simulated seconds that the whole run takes.
        replay_speed: Simulated seconds that a second of the replay shows.
        metrics: The figures, once measured.
    """

    scenario: Any
    study: Study
    diagram: Any
    signals: dict[str, np.ndarray] = field(default_factory=dict)
    wall_time: float = 0.0
    simulated: float = 0.0
    instants: list[float] = field(default_factory=list)
    updates: dict[str, float] = field(default_factory=dict)
    error: str = ""
    duration: float = 0.0
    replay_speed: float = 1.0
    metrics: dict[str, Any] = field(default_factory=dict)

    def matrix(self, name: str) -> np.ndarray:
        """All columns of one port, shape (samples, columns)."""
        return np.column_stack([self.signals[c] for c in columns(self.study, name)])


def columns(study: Study, port: str) -> list[str]:
    """Names of a port's columns in the log."""
    parts = study.signals[port]
    return [f"{port}.{part}" for part in parts] if len(parts) > 1 else [port]


def start(diagram: Any, config: SimulatorConfig, context: Any = None) -> Simulator:
    """A simulator of a diagram at the start of a run, with the run's integrator."""
    simulator = Simulator(diagram, context)
    ApplySimulatorConfig(config, simulator)
    return simulator


def simulate(
    scenario: Any,
    meshcat: Any = None,
    progress: Progress = lambda time, duration: None,
) -> Run:
    """Runs a scenario and returns its log; raises nothing that a run can survive.

    An error or an interruption in mid-run ends it; what was logged until then
    is kept and `Run.error` says why.

    Args:
        scenario: A study's scenario.
        meshcat: Records into this Meshcat if given. Frames are drawn between the
            timed advances, so that they do not count as simulation time.
        progress: Called after every frame with the simulated time and that of the
            whole run [s].

    Raises:
        ScenarioError: If the scenario cannot run.
    """
    check_scenario(scenario)
    return simulate_diagram(scenario, build(scenario), meshcat, progress)


def simulate_diagram(
    scenario: Any,
    diagram: Any,
    meshcat: Any = None,
    progress: Progress = lambda time, duration: None,
) -> Run:
    """Runs a diagram of one's own making, for example with swapped blocks.

    Args:
        scenario: The scenario that it was made for.
        diagram: Exports the ports that the scenario's study logs.
        meshcat: As for `simulate`.
        progress: As for `simulate`.
    """
    study = get_study(scenario.system)
    builder = DiagramBuilder()
    station = builder.AddNamedSystem("station", diagram)
    ports = logged_ports(station, study)
    sink = add_log(builder, station, ports, study.log_period)
    duration = study.length(scenario)
    speed = replay_speed(study, duration)
    recorder = replay.add_recorder(builder, station, meshcat, study, speed)
    root = builder.Build()
    config = study.integrator(scenario)
    simulator = start(root, config)
    context = simulator.get_mutable_context()
    root.SetRandomContext(context, RandomGenerator(scenario.seed))
    run = Run(scenario, study, root, duration=duration, replay_speed=speed)
    first = start(root, config, context.Clone())
    rehearse(lambda: first.AdvanceTo(1.5 * study.log_period))
    STOPWATCH.reset()
    gc.disable()  # nothing in a run makes cycles, and the collector costs 5 %
    try:
        advance(run, simulator, recorder, progress)
    except KeyboardInterrupt:
        run.error = "interrupted"
    except (Exception, SystemExit) as error:  # Drake ends some errors in SystemExit
        run.error = f"{type(error).__name__}: {error}"
    finally:
        gc.enable()
    run.simulated = context.get_time()
    try:
        study.keep(scenario, station, context, True)
    except OSError as error:
        run.error = run.error or f"what was done could not be saved: {error}"
    run.signals = read_log(sink, study, ports, context)
    run.instants = STOPWATCH.whole_instants(study.controller)
    run.updates = STOPWATCH.per_block()
    if len(run.signals["time"]) > 1:
        run.metrics = metrics.common(run) | study.measure(run)
    recorder.finish(run)
    return run


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
    progress: Progress,
) -> None:
    """Steps the simulator from frame to frame; only the steps are timed."""
    duration, period = run.duration, run.replay_speed / run.study.frame_rate
    simulator.Initialize()
    recorder.draw(simulator.get_context())
    station = run.diagram.GetSubsystemByName("station")
    time, frame = 0.0, 0
    while time < duration:
        frame += 1
        time = min(frame * period, duration)
        run.study.adjust(run.scenario, station, simulator.get_mutable_context())
        start = perf_counter()
        simulator.AdvanceTo(time)
        run.wall_time += perf_counter() - start
        recorder.draw(simulator.get_context())
        progress(time, duration)
        run.study.keep(run.scenario, station, simulator.get_context(), False)


def logged_ports(station: Any, study: Study) -> list[str]:
    """The study's signals, without the optional ones that this diagram lacks."""
    return [
        name
        for name in study.signals
        if name not in study.optional or station.HasOutputPort(name)
    ]


def add_log(builder: Any, station: Any, names: list[str], period: float) -> Any:
    """Logs signals of a diagram, one below the other, in one sink.

    One sink for all: each system of a diagram costs time at each of its steps.
    """
    ports = [station.GetOutputPort(name) for name in names]
    bundle = builder.AddNamedSystem(
        "signals", Multiplexer([port.size() for port in ports])
    )
    for index, port in enumerate(ports):
        builder.Connect(port, bundle.get_input_port(index))
    sink = LogVectorOutput(bundle.get_output_port(), builder, period)
    sink.set_name("log")
    return sink


def read_log(
    sink: Any, study: Study, ports: list[str], context: Any
) -> dict[str, np.ndarray]:
    """All columns of the log; "time" is the first."""
    log = sink.FindLog(context)
    names = [name for port in ports for name in columns(study, port)]
    signals = {"time": log.sample_times().copy()}
    for name, row in zip(names, log.data(), strict=True):
        signals[name] = row.copy()
    return signals


def prepare_folder(out: Path) -> None:
    """Makes the output folder, or raises a ScenarioError if it cannot be written."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".writable"
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise ScenarioError(
            f"cannot write to the output folder {str(out)!r}: {error.strerror}"
        ) from error


def save_signals(run: Run, path: Path) -> None:
    """Writes the log as CSV, one column a signal: `pandas.read_csv(path)`."""
    names = list(run.signals)
    table = np.column_stack([run.signals[name] for name in names])
    np.savetxt(
        path, table, fmt="%.9g", delimiter=",", header=",".join(names), comments=""
    )


def run_scenario(
    scenario: Any,
    out: Path,
    with_replay: bool = True,
    progress: Progress = lambda time, duration: None,
) -> Run:
    """Runs a scenario and writes all its results into a folder.

    Writes `scenario.yaml`, `signals.csv`, `metrics.json`, the plots as PNG and
    `replay.html`, in this order, so that nothing computed is lost if a later
    one fails.

    Raises:
        ScenarioError: If the scenario cannot run or the folder not be written.
    """
    prepare_folder(out)
    check_scenario(scenario)
    meshcat = replay.start_meshcat() if with_replay else None
    save_scenario(scenario, out)
    run = simulate(scenario, meshcat, progress)
    save_signals(run, out / "signals.csv")
    (out / "metrics.json").write_text(json.dumps(run.metrics, indent=2) + "\n")
    if run.metrics:
        for name, figure in run.study.plots(run).items():
            save_figure(figure, out / f"{name}.png")
    if meshcat is not None:
        (out / "replay.html").write_text(meshcat.StaticHtml())
    return run
