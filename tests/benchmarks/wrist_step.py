"""What one control step of the wrist costs: estimator and emulation together.

The median wall time that the two blocks take on the readings of `pwe_breathing`,
without the plant's own work.
"""

from collections.abc import Mapping
import statistics
from time import perf_counter
from typing import Any

import numpy as np

from diagrams.common.run import simulate
from diagrams.studies import load_scenario
from systems.common.signal import example, flat
from systems.common.signals import ToolMotion
from systems.passive_wrist.fulcrum_estimator import FulcrumEstimator
from systems.passive_wrist.passive_wrist_emulation import PassiveWristEmulation


def timed(
    block: Any, context: Any, time: float, inputs: Mapping[str, Any], output: str
) -> tuple[float, np.ndarray]:
    """Wall time in s of a block's output and update at an instant, and the output."""
    context.SetTime(time)
    for name, value in inputs.items():
        block.GetInputPort(name).FixValue(context, value)
    start = perf_counter()
    value = block.GetOutputPort(output).Eval(context)
    update = block.EvalUniquePeriodicDiscreteUpdate(context)
    wall = perf_counter() - start
    context.SetDiscreteState(update)
    return wall, value


def report(seed: int, scenes: int) -> str:
    """Times both blocks on what their sensor has read in a run."""
    run = simulate(load_scenario("pwe_breathing", ["compare=[]"], seed, 12.0))
    estimator, wrist = FulcrumEstimator(), PassiveWristEmulation()
    contexts = estimator.CreateDefaultContext(), wrist.CreateDefaultContext()
    wanted = {"tool_wanted": flat(example(ToolMotion))}
    walls = []
    for time, shaft, wrench in zip(
        run.signals["time"],
        np.column_stack(run.wrist.shaft),
        np.column_stack(run.wrist.wrench),
        strict=True,
    ):
        seen = {"shaft": shaft, "wrench": wrench}
        first, fulcrum = timed(estimator, contexts[0], time, seen, "estimate")
        seen |= wanted | {"estimate": fulcrum}
        walls.append(first + timed(wrist, contexts[1], time, seen, "tool")[0])
    walls.sort()
    return (
        f"estimator and emulation: median {statistics.median(walls) * 1e6:.0f} us, "
        f"95 % {walls[int(0.95 * len(walls))] * 1e6:.0f} us of a step of "
        f"{1e3 / 120:.1f} ms; {len(walls)} steps, real-time factor "
        f"{run.metrics['real_time_factor']:.1f}"
    )
