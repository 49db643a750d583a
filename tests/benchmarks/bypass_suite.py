"""The bypass beside the paper's forms in random scenes: reached, contact, clearance.

Sets: the kinds of `diagrams.gauze.scenes`, and the moving one as the tracker sees it.
The time ratio is the first arrival over that of the straight motion without O.
"condition" counts the scenes in which the evasion condition failed at some instant, and
of the contacts those among them.
"""

from dataclasses import dataclass
import statistics

import numpy as np

from diagrams.gauze.kinematic_loop import (
    PLANNER_PERIOD,
    Outcome,
    estimate,
    run,
)
from diagrams.gauze.kinematic_planners import (
    BYPASS,
    FIELD,
    PLANNERS,
    ROBOT,
    SPEED,
    Constrained,
    LocalPlanner,
    around,
)
from diagrams.gauze.scenes import Scene, scene
from systems.auto_guidance.go_to_target import guide_point
from systems.bypass.bypass_route import up_and_over
from systems.bypass.obstacle_tools import Margins
from systems.common.geometry import limited, norm, plus, scaled, sub
from systems.common.signal import Vector
from systems.common.signals import Guide, RobotTool
from tests.benchmarks.tracked import tracked


class Straight:
    """Attraction alone, with the bypass's law of speed."""

    def __init__(self) -> None:
        self._v: Vector = (0.0, 0.0, 0.0)

    def step(self, dt, robot, obstacle, target, others=()) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        way = sub(target.p, robot.tip)
        wanted = limited(scaled(BYPASS.approach_rate, way), SPEED)
        change = limited(sub(wanted, self._v), BYPASS.max_acceleration * dt)
        self._v = plus(self._v, change)
        return self._v


class RetractTurnInsert(LocalPlanner):
    """Up and over everything, always: the bypass's fallback by itself, at its speed."""

    def _go_to_target(
        self, dt, robot, obstacle, target, others
    ) -> tuple[Vector, Guide]:
        tools = around(obstacle, others)
        keep = np.full(len(tools), Margins().safe_distance + BYPASS.goal_slack)
        direction, length = up_and_over(
            tools, keep, ROBOT.least_insertion, robot.fulcrum, robot.tip, target.p
        )
        wanted = scaled(min(SPEED, BYPASS.approach_rate * length), direction)
        change = limited(sub(wanted, self._v1_tip), BYPASS.max_acceleration * dt)
        guide = guide_point(robot, obstacle, target.p, BYPASS.proportion_floor)
        return plus(self._v1_tip, change), guide


ALL = {
    name: make
    for name, make in PLANNERS.items()
    if name != "field only" and not name.startswith("literal")
} | {
    "straight + constraint": lambda: Constrained(Straight()),
    "retract, turn, insert": lambda: Constrained(RetractTurnInsert(**FIELD)),
    "the same alone": lambda: Constrained(RetractTurnInsert(**FIELD, field_only=True)),
}
"""Alone: without the paper's fuzzy sum between it and the constraint."""
FIRST = {"standing": 1.0, "moving": 1.0, "tracked": 1.0, "blocked": 0.2, "crowded": 0.3}
"""The sets, and their sizes as shares of the number of scenes."""

CONSTRAINED = ["bypass", "field + constraint", "straight + constraint"]
ROWS = {
    "standing": list(ALL),
    "moving": list(ALL),
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


def straight_time(given: Scene) -> float:
    """Time of the straight motion to within 1 mm of the target without O, s."""
    planner = Straight()
    tip = given.p_WPr
    target = estimate(given.p_WPs, given.p_WPs)
    for k in range(3600):
        if norm(sub(tip, given.p_WPs)) < 1e-3:
            return k * PLANNER_PERIOD
        robot = RobotTool(given.p_WGr, tip)
        v = planner.step(PLANNER_PERIOD, robot, target, target)
        tip = ROBOT.moved(given.p_WGr, tip, v, PLANNER_PERIOD)
    return float("nan")


def run_scene(kind: str, name: str, seed: int, number: int) -> Result:
    """Runs one planner in one scene."""
    given = scene("moving" if kind == "tracked" else kind, seed, number)
    planner = ALL[name]()
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


def report(seed: int, scenes: int) -> str:
    """The table of all sets and planners, as text."""
    lines = [HEADER]
    for kind, share in FIRST.items():
        count = max(1, round(scenes * share))
        for name in ROWS[kind]:
            results = [run_scene(kind, name, seed, k) for k in range(count)]
            lines.append(row(kind, name, results))
    return "\n".join(lines)
