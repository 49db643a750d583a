"""Synthetic hands of 20 s in the kinematic loop: contact, and what could be avoided.

R travels at 60 mm/s, and gets out of the way at up to 250 mm/s along its shaft, 1 rad/s
and 4 m/s^2. "slow" is R as it was: 100 mm/s in everything. "condition" counts the
scenes in which the evasion condition failed at some instant, and of the contacts those
among them; "unavoidable" those in which a robot told the future is touched as well.
"""

from dataclasses import dataclass

import numpy as np

from diagrams.gauze.foresight import Reach, unavoidable
from diagrams.gauze.kinematic_loop import PLANNER_PERIOD, Outcome, Robot, run
from diagrams.gauze.kinematic_planners import robot_of, traveller
from diagrams.gauze.scenes import CONTACT, Scene, scene
from systems.bypass.clearance_constraint import ClearanceConstraintParams

SECONDS = 20.0
FAST = ClearanceConstraintParams()
SLOW = ClearanceConstraintParams(max_speed=0.1, acceleration=1.0)
ROWS = {"dodging": FAST, "slow": SLOW}


@dataclass
class Result:
    """A scene's outcome, whether the condition held, whether it is unavoidable."""

    outcome: Outcome
    holds: bool
    unavoidable: bool


def cannot_be_avoided(given: Scene, robot: Robot) -> bool:
    """Whether a robot that knew the future would be touched."""
    times = np.arange(0.0, SECONDS, PLANNER_PERIOD)
    tips = np.array([given.obstacle_tip(t)[0] for t in times.tolist()])[:, None]
    fulcrums = np.broadcast_to(np.array(given.p_WGo), tips.shape).copy()
    reach = Reach(
        robot.max_speed,
        robot.max_acceleration,
        robot.max_turning,
        robot.least_insertion,
        1.2,
    )
    start = given.p_WPr
    return unavoidable(reach, CONTACT, times, given.p_WGr, start, tips, fulcrums)


def run_scene(seed: int, number: int, params: ClearanceConstraintParams) -> Result:
    """Runs a scene to its end."""
    given = scene("hands", seed, number)
    planner = traveller(params)
    robot = robot_of(params)
    outcome = run(given, planner, robot, SECONDS)
    return Result(outcome, planner.holds, cannot_be_avoided(given, robot))


def row(name: str, results: list[Result]) -> str:
    """A line of the table."""
    n = len(results)
    contact = [r for r in results if r.outcome.contact]
    failed = sum(not r.holds for r in results)
    among = sum(not r.holds for r in contact)
    hopeless = sum(r.unavoidable for r in results)
    least = 1e3 * min(r.outcome.clearance for r in results)
    arrived = sum(r.outcome.time is not None for r in results)
    return (
        f"{name:10} {n:5d} {arrived:7d} {len(contact):8d} {failed:6d} ({among}) "
        f"{hopeless:12d} {least:9.2f}"
    )


def report(seed: int, scenes: int) -> str:
    """The table, as text."""
    lines = [
        f"{'robot':10} {'n':>5} {'arrived':>7} {'contact':>8} {'condition':>10} "
        f"{'unavoidable':>12} {'least mm':>9}"
    ]
    for name, params in ROWS.items():
        lines.append(row(name, [run_scene(seed, k, params) for k in range(scenes)]))
    return "\n".join(lines)
