"""How fast the gauze delivery runs, and where its time goes.

The real-time factor and the planner step of `gauze_dynamic`, and its wall time beside
that of the plant alone, which is led along the same motion by set-points at the same
rate. Timings are noisy on a machine that does something else: each is the median of
several runs, and the ratios hold better than the times.
"""

from collections import defaultdict
from dataclasses import dataclass
import gc
import statistics
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from diagrams.common.run import Run, simulate, start
from diagrams.common.study import cenic
from diagrams.gauze.theatre import add_theatre
from diagrams.studies import build, load_scenario
from systems.common.compiled import rehearse
from systems.common.stopwatch import STOPWATCH


@dataclass
class Share:
    """A part of the run.

    Attributes:
        name: What it is.
        wall: Wall seconds per simulated second.
        calls: Median wall seconds of its calls in one instant; None if it has none.
    """

    name: str
    wall: float
    calls: float | None = None


def timed(system: Any, context: Any, duration: float) -> float:
    """Wall seconds per simulated second of a system's advance."""
    first = start(system, cenic(), context.Clone())
    rehearse(lambda: first.AdvanceTo(0.05))
    simulator = start(system, cenic(), context)
    simulator.Initialize()
    STOPWATCH.reset()
    gc.disable()
    began = perf_counter()
    simulator.AdvanceTo(duration)
    wall = perf_counter() - began
    gc.enable()
    return wall / duration


def without_log(scenario: Any) -> float:
    """Wall seconds per simulated second with nothing logged."""
    diagram = build(scenario)
    context = diagram.CreateDefaultContext()
    diagram.SetRandomContext(context, RandomGenerator(scenario.seed))
    return timed(diagram, context, scenario.duration)


def plant_alone(scenario: Any, run: Run) -> float:
    """Wall seconds per simulated second of the plant on a run's motion."""
    builder = DiagramBuilder()
    plant = add_theatre(builder, scenario).systems["plant"]
    times, rows = np.unique(run.signals["time"], return_index=True)
    posture = run.joints.posture.q[rows]
    states = np.hstack([posture, np.zeros_like(posture)])
    motion = PiecewisePolynomial.FirstOrderHold(times, states.T)
    source = builder.AddSystem(TrajectorySource(motion))
    hold = builder.AddSystem(ZeroOrderHold(scenario.joints.period, states.shape[1]))
    builder.Connect(source.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.GetInputPort("pa10_desired_state"))
    diagram = builder.Build()
    return timed(diagram, diagram.CreateDefaultContext(), scenario.duration)


def block_shares(duration: float) -> list[Share]:
    """What the stopwatch has seen, the largest first."""
    sums: dict[str, float] = defaultdict(float)
    for name, _, wall, _ in STOPWATCH.rows:
        sums[name] += wall / duration
    medians = STOPWATCH.per_block()
    shares = [Share(f"  {name}", wall, medians[name]) for name, wall in sums.items()]
    return sorted(shares, key=lambda share: -share.wall)


def measure(scenario: Any, runs: int) -> tuple[list[Run], list[Share]]:
    """Runs a scenario; returns the runs and where their time goes."""
    full = [simulate(scenario) for _ in range(runs)]
    alone = statistics.median(plant_alone(scenario, full[0]) for _ in range(runs))
    bare = statistics.median(without_log(scenario) for _ in range(runs))
    blocks = block_shares(scenario.duration)
    in_blocks = sum(share.wall for share in blocks)
    whole = statistics.median(run.wall_time / run.simulated for run in full)
    return full, [
        Share("plant alone", alone),
        Share("blocks", in_blocks),
        *blocks,
        Share("events and caches of the diagram", bare - alone - in_blocks),
        Share("logging, clearances, wall force", whole - bare),
        Share("all", whole),
    ]


def table(shares: list[Share]) -> str:
    """The shares, beside the plant alone."""
    alone = shares[0].wall
    lines = [
        "wall time per simulated second             ms   of plant alone   per instant"
    ]
    for share in shares:
        calls = "" if share.calls is None else f"{share.calls * 1e6:9.1f} us"
        ratio = share.wall / alone
        lines.append(f"{share.name:<36} {share.wall * 1e3:8.2f} {ratio:16.2f}  {calls}")
    lines.append("(a block's time contains the blocks that it is the first to ask)")
    return "\n".join(lines)


def summary(runs: list[Run]) -> str:
    """The two figures of the runs, against what is wanted of them."""
    lines = []
    for key, scale, unit in (
        ("real_time_factor", 1.0, "(wanted: 30 or more)"),
        ("planner_step_median", 1e6, "us (wanted: 150 or less)"),
    ):
        values = sorted(run.metrics[key] * scale for run in runs)
        middle, low, high = statistics.median(values), values[0], values[-1]
        lines.append(f"{key:<20} {middle:6.1f} {unit}, from {low:.1f} to {high:.1f}")
    return "\n".join(lines)


def report(seed: int, scenes: int) -> str:
    """The figures and the table; `scenes` is for other benchmarks."""
    done, shares = measure(load_scenario("gauze_dynamic", seed=seed), 5)
    return f"{summary(done)}\n\n{table(shares)}"
