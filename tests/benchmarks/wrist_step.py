"""What one control step of the wrist costs: estimator and emulation together.

The median wall time that the two blocks take in the loop of `pwe_breathing`, without
the plant's own work.
"""

from collections import defaultdict
from collections.abc import Callable
import statistics
from time import perf_counter
from typing import Any

from diagrams.common.run import simulate
from diagrams.studies import load_scenario
from systems.passive_wrist.fulcrum_estimator import FulcrumEstimator
from systems.passive_wrist.passive_wrist_emulation import PassiveWristEmulation

TIMED = {
    FulcrumEstimator: ("_calc_posterior", "_calc_estimate"),
    PassiveWristEmulation: ("_calc_next", "_calc_tool"),
}
OTHERS = "_calc_wrench", "_calc_shaft"


def report(seed: int, scenes: int) -> str:
    """Times the blocks' calculations, what they pull from others taken away."""
    from systems.sensing.tool_wrench import ToolWrench

    own: dict[float, float] = defaultdict(float)
    inner: list[float] = []

    def timed(function: Callable[..., Any], counted: bool) -> Callable[..., Any]:
        def call(block: Any, context: Any) -> Any:
            inner.append(0.0)
            start = perf_counter()
            value = function(block, context)
            wall = perf_counter() - start
            pulled = inner.pop()
            if counted:
                own[context.get_time()] += wall - pulled
            if inner:
                inner[-1] += wall
            return value

        return call

    for kind, names in (*TIMED.items(), (ToolWrench, OTHERS)):
        for name in names:
            setattr(kind, name, timed(getattr(kind, name), kind in TIMED))
    run = simulate(load_scenario("pwe_breathing", ["compare=[]"], seed, 12.0))
    walls = sorted(own.values())
    return (
        f"estimator and emulation: median {statistics.median(walls) * 1e6:.0f} us, "
        f"95 % {walls[int(0.95 * len(walls))] * 1e6:.0f} us of a step of "
        f"{1e3 / 120:.1f} ms; {len(walls)} steps, real-time factor "
        f"{run.metrics['real_time_factor']:.1f}"
    )
