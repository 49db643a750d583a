"""Running a scenario: build, advance, log; then measure, plot and replay."""

from collections.abc import Callable
from dataclasses import dataclass, field
import gc
import json
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
from pydrake.systems.primitives import LogVectorOutput

from diagrams.common import metrics, replay
from diagrams.common.plots import save_figure
from diagrams.common.scenario import ScenarioError, check_scenario, save_scenario
from diagrams.common.study import Study, build, get_study
from systems.common.stopwatch import STOPWATCH

INTEGRATOR = SimulatorConfig(
    integration_scheme="cenic",
    accuracy=1e-3,
    max_step_size=0.01,
)
"""All plants are continuous and stepped by CENIC."""


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
    metrics: dict[str, Any] = field(default_factory=dict)

    def matrix(self, name: str) -> np.ndarray:
        """All columns of one port, shape (samples, columns)."""
        return np.column_stack([self.signals[c] for c in columns(self.study, name)])


def columns(study: Study, port: str) -> list[str]:
    """Names of a port's columns in the log."""
    parts = study.signals[port]
    return [f"{port}.{part}" for part in parts] if len(parts) > 1 else [port]


def simulate(
    scenario: Any,
    meshcat: Any = None,
    progress: Callable[[float], None] = lambda time: None,
) -> Run:
    """Runs a scenario and returns its log; raises nothing that a run can survive.

    An error or an interruption in mid-run ends it; what was logged until then
    is kept and `Run.error` says why.

    Args:
        scenario: A study's scenario.
        meshcat: Records into this Meshcat if given. Frames are drawn between the
            timed advances, so that they do not count as simulation time.
        progress: Called with the simulated time [s] after every frame.

    Raises:
        ScenarioError: If the scenario cannot run.
    """
    check_scenario(scenario)
    study = get_study(scenario.system)
    builder = DiagramBuilder()
    station = builder.AddNamedSystem("station", build(scenario))
    sinks = {
        port: LogVectorOutput(station.GetOutputPort(port), builder, study.log_period)
        for port in study.signals
        if port not in study.optional or station.HasOutputPort(port)
    }
    for port, sink in sinks.items():
        sink.set_name(f"log({port})")
    recorder = replay.add_recorder(builder, station, meshcat, study)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    ApplySimulatorConfig(INTEGRATOR, simulator)
    context = simulator.get_mutable_context()
    diagram.SetRandomContext(context, RandomGenerator(scenario.seed))
    run = Run(scenario, study, diagram)
    STOPWATCH.reset()
    gc.disable()  # nothing in a run makes cycles, and the collector costs 5 %
    try:
        simulator.Initialize()
        recorder.draw(context)
        for frame in range(1, int(scenario.duration * study.frame_rate) + 2):
            time = min(frame / study.frame_rate, scenario.duration)
            study.adjust(scenario, station, context)
            start = perf_counter()
            simulator.AdvanceTo(time)
            run.wall_time += perf_counter() - start
            recorder.draw(context)
            progress(time)
            if time == scenario.duration:
                break
    except KeyboardInterrupt:
        run.error = "interrupted"
    except (Exception, SystemExit) as error:  # Drake ends some errors in SystemExit
        run.error = f"{type(error).__name__}: {error}"
    finally:
        gc.enable()
    run.simulated = context.get_time()
    for port, sink in sinks.items():
        log = sink.FindLog(context)
        run.signals.setdefault("time", log.sample_times().copy())
        names = columns(study, port)
        for name, row in zip(names, log.data(), strict=True):
            run.signals[name] = row.copy()
    shortest = min(len(column) for column in run.signals.values())
    run.signals = {name: column[:shortest] for name, column in run.signals.items()}
    run.instants = STOPWATCH.whole_instants(study.controller)
    run.updates = STOPWATCH.per_block()
    if shortest > 1:
        run.metrics = metrics.common(run) | study.measure(run)
    recorder.finish(run)
    return run


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
    progress: Callable[[float], None] = lambda time: None,
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
