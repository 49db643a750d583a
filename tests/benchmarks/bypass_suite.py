"""The bypass beside the paper's forms in random scenes: reached, contact, clearance.

`python -m tests.benchmarks.bypass_suite --scenes 1000` prints the table. Sets: standing
and moving obstacle (`crossed_scenes`), moving as the tracker sees it, standing on the
target's line and leaving after 6 s, and two or three tools standing (`bypass_scenes`).
The time ratio is the first arrival over that of
the straight motion without O. "condition" counts the scenes in which the evasion
condition failed at some instant, and of the contacts those among them.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
import statistics

import numpy as np

from systems.common.geometry import norm, sub
from tests.benchmarks.bypass_planners import PLANNERS, Constrained, Straight
from tests.benchmarks.bypass_scenes import blocked_scene, crowded_scene
from tests.benchmarks.crossed_scenes import Scene, scene
from tests.benchmarks.kinematic_loop import (
    PLANNER_PERIOD,
    Outcome,
    Robot,
    estimate,
    run,
)
from tests.benchmarks.tracked import tracked

FIRST = {"standing": 1.0, "moving": 1.0, "tracked": 1.0, "blocked": 0.2, "crowded": 0.3}
"""The sets, and their sizes as shares of the number of scenes."""

ALL = list(PLANNERS)
CONSTRAINED = ["bypass", "field + constraint", "straight + constraint"]
ROWS = {
    "standing": ALL,
    "moving": ALL,
    "tracked": CONSTRAINED,
    "blocked": CONSTRAINED,
    "crowded": [*CONSTRAINED, "retract, turn, insert"],
}
"""The planners that each set is run with."""


@dataclass
class Result:
    """A scene's outcome and what the planner noted.

    Attributes:
        outcome: What came of it.
        ratio: Time of arrival over that of the straight motion, None without one.
        holds: Whether the evasion condition held all the time.
        seconds: Wall time of the planner's steps, s.
        edge_switches: Changes from one edge to another.
    """

    outcome: Outcome
    ratio: float | None
    holds: bool
    seconds: list[float]
    edge_switches: int


def make_scene(kind: str, seed: int, number: int) -> Scene:
    """A scene of a set."""
    if kind == "blocked":
        return blocked_scene(seed, number)
    if kind == "crowded":
        return crowded_scene(seed, number)
    return scene("moving" if kind == "tracked" else kind, seed, number)


def straight_time(given: Scene) -> float:
    """Time of the straight motion to within 1 mm of the target without O, s."""
    planner, robot = Straight(), Robot()
    tip = given.p_WPr
    target = estimate(given.p_WPs, given.p_WPs)
    for k in range(3600):
        if norm(sub(tip, given.p_WPs)) < 1e-3:
            return k * PLANNER_PERIOD
        v = planner.step(PLANNER_PERIOD, [*given.p_WGr, *tip], target, target)
        tip = robot.moved(given.p_WGr, tip, v, PLANNER_PERIOD)
    return float("nan")


def run_scene(kind: str, name: str, seed: int, number: int) -> Result:
    """Runs one planner in one scene."""
    given = make_scene(kind, seed, number)
    planner = PLANNERS[name]()
    sense = None
    if kind == "tracked":
        sense = tracked(seed, number, given.p_WGo[2])
    outcome = run(given, planner, sense=sense)
    ratio = None
    if outcome.time is not None and outcome.reached:
        ratio = outcome.time / straight_time(given)
    inner = planner
    holds, seconds = True, []
    if isinstance(planner, Constrained):
        inner, holds, seconds = planner.inner, planner.holds, planner.seconds
    switches = getattr(inner, "edge_switches", 0)
    return Result(outcome, ratio, holds, seconds, switches)


HEADER = (
    f"{'scenes':9} {'planner':22} {'n':>5} {'reached':>7} {'contact':>7} {'stuck':>6} "
    f"{'surface min / p1 / median':>26} {'ratio median / p95':>18} {'condition':>10} "
    f"{'switches':>8} {'us median / mean':>17}"
)


def row(kind: str, name: str, results: list[Result]) -> str:
    """A line of the table."""
    outcomes = [r.outcome for r in results]
    n = len(outcomes)
    reached = sum(o.reached for o in outcomes)
    contact = sum(o.contact for o in outcomes)
    clearance = np.sort([1e3 * o.clearance for o in outcomes])
    ratios = np.sort([r.ratio for r in results if r.ratio is not None])
    failed = [r for r in results if not r.holds]
    among = sum(r.outcome.contact for r in failed)
    seconds = [1e6 * s for r in results for s in r.seconds[5:]]
    surface = (
        f"{clearance[0]:6.2f} / {clearance[n // 100]:5.2f} / {clearance[n // 2]:5.2f}"
    )
    ratio = "-"
    if len(ratios):
        p95 = ratios[min(len(ratios) - 1, int(0.95 * len(ratios)))]
        ratio = f"{statistics.median(ratios):.2f} / {p95:.2f}"
    wall = "-"
    if seconds:
        wall = f"{statistics.median(seconds):.0f} / {statistics.mean(seconds):.0f}"
    switches = sum(r.edge_switches for r in results)
    condition = f"{len(failed)} ({among})" if results[0].seconds else "-"
    return (
        f"{kind:9} {name:22} {n:5d} {reached:7d} {contact:7d} "
        f"{n - reached - contact:6d} {surface:>26} {ratio:>18} {condition:>10} "
        f"{switches:8d} {wall:>17}"
    )


def rows(
    seed: int, scenes: int, kinds: list[str], names: list[str] | None = None
) -> Iterator[str]:
    """The table's lines, one by one."""
    yield HEADER
    for kind in kinds:
        count = max(1, round(scenes * FIRST[kind]))
        for name in names or ROWS[kind]:
            yield row(
                kind, name, [run_scene(kind, name, seed, k) for k in range(count)]
            )


def report(seed: int, scenes: int) -> str:
    """The table of all sets and planners, as text."""
    return "\n".join(rows(seed, scenes, list(FIRST)))


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1000, help="of the large sets")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", action="append", choices=list(FIRST))
    parser.add_argument("--planner", action="append", choices=ALL)
    args = parser.parse_args()
    if args.scenes < 1:
        parser.error(f"--scenes {args.scenes}: must be at least 1")
    for line in rows(args.seed, args.scenes, args.set or list(FIRST), args.planner):
        print(line, flush=True)


if __name__ == "__main__":
    main()
