"""A kinematic loop round a planner: an ideal robot's tool among ideal tools.

The robot's tip follows the commanded velocity within its limits, its shaft goes
through a known fulcrum, and the obstacle's state is exact. What is left is the
planner. Another planner, a constraint behind it or noise before it takes part by
offering `step`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from diagrams.gauze.scenes import CONTACT, Scene
from systems.common.geometry import (
    across,
    along,
    closest_points,
    dot,
    limited,
    norm,
    plus,
    sub,
    unit,
)
from systems.common.signal import Vector, vector
from systems.common.signals import Estimate, RobotTool

PLANNER_PERIOD = 1.0 / 60.0


class Planner(Protocol):
    """What the loop asks of a planner; a new one is made for every scene."""

    def step(
        self,
        dt: float,
        robot: RobotTool,
        obstacle: Estimate,
        target: Estimate,
        others: Sequence[Estimate] = (),
    ) -> Vector:
        """The velocity of the robot's tip for the next `dt` seconds, m/s.

        Args:
            dt: Length of the step, s.
            robot: R.
            obstacle: Of O.
            target: Of S.
            others: Of further tools.
        """


def estimate(
    p: Sequence[float],
    fulcrum: Sequence[float],
    v: Sequence[float] = (0.0, 0.0, 0.0),
    a: Sequence[float] = (0.0, 0.0, 0.0),
) -> Estimate:
    """An exact estimate of a tool."""
    exact = (0.0, 0.0, 0.0, 1.0, 0.0)
    return Estimate(vector(p), vector(v), vector(a), vector(fulcrum), *exact)


@dataclass(frozen=True)
class Robot:
    """Limits of the ideal robot.

    Attributes:
        max_speed: Of the tip, m/s.
        max_turning: Of the shaft, rad/s.
        least_insertion: m.
        max_acceleration: Of the tip, m/s^2; unlimited where it is infinite.
    """

    max_speed: float = 0.1
    max_turning: float = 1.0
    least_insertion: float = 0.015
    max_acceleration: float = float("inf")

    def moved(self, g: Vector, p: Vector, v: Vector, dt: float) -> Vector:
        """The tip after `dt` seconds at velocity v within the limits."""
        shaft = sub(p, g)
        q = norm(shaft)
        u = unit(shaft)
        turning = limited(across(v, u), q * self.max_turning)
        velocity = limited(along(turning, dot(v, u), u), self.max_speed)
        shaft = sub(along(p, dt, velocity), g)
        q = norm(shaft)
        if q < self.least_insertion:
            return along(g, self.least_insertion / q, shaft)
        return plus(g, shaft)


@dataclass
class Outcome:
    """What came of a scene.

    Attributes:
        reached: The tip is within 1 mm of the target with O at rest, and no
            contact was made.
        contact: The tools touched.
        clearance: Least distance of the surfaces, m; what it was at contact.
        fraction: l/L on O where the clearance was least.
        time: Of the first arrival within 1 mm, s; None without one.
    """

    reached: bool
    contact: bool
    clearance: float
    fraction: float
    time: float | None


def run(
    scene: Scene,
    planner: Planner,
    robot: Robot | None = None,
    time_limit: float = 15.0,
    watch: Callable[[float, Vector], None] | None = None,
    sense: Callable[[float, Estimate], Estimate] | None = None,
) -> Outcome:
    """Runs a scene to its end: contact, arrival with O at rest, or the limit.

    The planner is asked at 60 Hz; motion and clearance are followed at 240 Hz.

    Args:
        scene: The scene.
        planner: A fresh planner.
        robot: The robot's limits.
        time_limit: In seconds.
        watch: Called at every planner step with the time and the tip.
        sense: Makes of the time and O's exact estimate what the planner gets.
    """
    robot = robot or Robot()
    tip, velocity = scene.p_WPr, (0.0, 0.0, 0.0)
    clearance, fraction = float("inf"), 1.0
    arrival: float | None = None
    target = estimate(scene.p_WPs, scene.p_WPs)
    others = [estimate(p, g) for p, g in scene.others]
    substeps = 4
    dt = PLANNER_PERIOD / substeps
    for k in range(round(time_limit / PLANNER_PERIOD)):
        time = k * PLANNER_PERIOD
        p, v, a = scene.obstacle_tip(time)
        obstacle = estimate(p, scene.p_WGo, v, a)
        if sense:
            obstacle = sense(time, obstacle)
        tool = RobotTool(scene.p_WGr, tip)
        v_tip = planner.step(PLANNER_PERIOD, tool, obstacle, target, others)
        if watch:
            watch(time, tip)
        for i in range(substeps):
            change = limited(sub(v_tip, velocity), robot.max_acceleration * dt)
            velocity = plus(velocity, change)
            tip = robot.moved(scene.p_WGr, tip, velocity, dt)
            p = scene.obstacle_tip(time + (i + 1) * dt)[0]
            near = closest_points(scene.p_WGr, tip, scene.p_WGo, p)
            if near.distance - CONTACT < clearance:
                clearance, fraction = near.distance - CONTACT, near.t
            for p, g in scene.others:
                near = closest_points(scene.p_WGr, tip, g, p)
                if near.distance - CONTACT < clearance:
                    clearance, fraction = near.distance - CONTACT, 1.0
        if clearance <= 0.0:
            return Outcome(False, True, clearance, fraction, arrival)
        is_there = norm(sub(tip, scene.p_WPs)) < 1e-3
        if is_there and arrival is None:
            arrival = time + PLANNER_PERIOD
        if is_there and norm(v_tip) < 2e-3 and time > scene.rest_time:
            return Outcome(True, False, clearance, fraction, arrival)
    return Outcome(False, False, clearance, fraction, arrival)
