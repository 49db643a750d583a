"""Runs a planner through scenes and measures what becomes of the robot."""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from plants.crowd.walls import wall_distance
from systems.switching.evasion import Body
from systems.switching.heading_law import (
    UnicycleControlParams,
    constants,
    heading_law,
)
from systems.switching.signals import Corner, Seen
from tests.benchmarks.navigation_scenes import Frame, Robot, Scene
from tests.benchmarks.sensed import Sensed, Senses

Command = tuple[float, float, bool]
"""Velocity v_x, v_y [m/s], and whether the body may retreat backwards."""


class Now(NamedTuple):
    """What the robot knows: pose [m, rad], velocity [m/s], who and what is in sight."""

    x: float
    y: float
    theta: float
    vx: float
    vy: float
    seen: list[Seen]
    corners: list[Corner]
    omega: float = 0.0  # rad/s

    @property
    def place(self) -> tuple[float, float]:
        """Where it is [m]."""
        return self.x, self.y

    @property
    def v(self) -> tuple[float, float]:
        """Its velocity [m/s]."""
        return self.vx, self.vy

    @property
    def body(self) -> Body:
        """How it stands, for who reckons with its limits."""
        v = self.vx * cos(self.theta) + self.vy * sin(self.theta)
        return Body(self.theta, v, self.omega)


Step = Callable[[Now], Command]
"""What to do now."""

REACH = 0.2
"""Of the true goal [m], for a robot that only believes to be there."""
Planner = Callable[[Scene], Step]
"""Makes a fresh planner for a scene."""


@dataclass
class Result:
    """What became of one run."""

    outcome: str  # "reached", "collided" or "timeout"
    time: float  # s
    clearance: float  # m, least distance between surfaces
    length: float  # m
    ratio: float  # length over the straight way
    walls: list[float]  # s, wall time of each planner step
    path: list[tuple[float, float]]
    astray: float = 0.0  # m, greatest distance of the believed place from the true one
    met: float = 0.0  # m/s, speed of what it collided with; 0 for what stands


def closest(qx: float, qy: float, ux: float, uy: float, dt: float) -> float:
    """Least distance from the origin while q moves with velocity u for dt."""
    uu = ux * ux + uy * uy
    t = 0.0
    if uu > 0.0:
        t = min(max(-(qx * ux + qy * uy) / uu, 0.0), dt)
    return hypot(qx + t * ux, qy + t * uy)


def control_law(robot: Robot) -> Any:
    """The record that the heading law takes."""
    return constants(
        UnicycleControlParams(
            4.0, robot.speed, robot.turn_rate, robot.turn_acceleration
        )
    )[0]


def unicycle(
    robot: Robot,
    law: Any,
    pose: tuple[float, float, float],
    speeds: tuple[float, float],
    wanted: Command,
    dt: float,
    astray: float = 0.0,
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """One step of the heading law on a unicycle with limited accelerations.

    Its believed heading is wrong by `astray` [rad].
    """
    x, y, theta = pose
    speed, rate = speeds
    target, turn = heading_law(law, theta + astray, *wanted)
    dv = robot.acceleration * dt
    dw = robot.turn_acceleration * dt
    speed = min(max(target, speed - dv), speed + dv)
    rate = min(max(turn, rate - dw), rate + dw)
    middle = theta + 0.5 * dt * rate
    pose = (
        x + dt * speed * cos(middle),
        y + dt * speed * sin(middle),
        theta + dt * rate,
    )
    return pose, (speed, rate)


def run(
    scene: Scene, planner: Planner, senses: Senses | None = None, seed: int = 0
) -> Result:
    """Runs one scene until the goal, a collision or the time limit.

    Args:
        scene: The world.
        planner: Who drives.
        senses: What the robot has to see with; the truth within sight if None.
        seed: Of their noise.
    """
    robot, dt = scene.robot, scene.dt
    x, y = scene.start
    theta = atan2(scene.goal[1] - y, scene.goal[0] - x)
    speeds = (0.0, 0.0)
    vx = vy = 0.0
    step = planner(scene)
    law = None if robot.holonomic else control_law(robot)
    clearance, length = float("inf"), 0.0
    walls: list[float] = []
    path = [(x, y)]
    straight = hypot(scene.goal[0] - x, scene.goal[1] - y)
    outcome, astray, met = "timeout", 0.0, 0.0
    k = 0
    frame: Frame = scene.frames(0)
    sensed = Sensed(scene, senses, seed) if senses else None
    reach = max(robot.reach, REACH) if senses else robot.reach
    for k in range(int(scene.time_limit / dt)):
        if sensed is None:
            seen = [
                Seen(float(i), a, b, r, u, v)
                for i, (a, b, r, u, v) in enumerate(frame)
                if hypot(a - x, b - y) <= robot.vision
            ]
            place, hiding = (x, y, theta), []
        else:
            place, seen, hiding = sensed.at((x, y, theta), (vx, vy), frame, k * dt)
        astray = max(astray, hypot(place[0] - x, place[1] - y))
        start = perf_counter()
        wanted = step(Now(*place, vx, vy, seen, hiding, speeds[1]))
        walls.append(perf_counter() - start)
        if robot.holonomic:
            size = hypot(wanted[0], wanted[1])
            scale = min(1.0, robot.speed / size) if size else 0.0
            vx, vy = wanted[0] * scale, wanted[1] * scale
            nx, ny = x + dt * vx, y + dt * vy
        else:
            (nx, ny, theta), speeds = unicycle(
                robot, law, (x, y, theta), speeds, wanted, dt, place[2] - theta
            )
            vx, vy = (nx - x) / dt, (ny - y) / dt
        after = scene.frames(k + 1)
        for (a, b, r, _, _), (c, d, _, _, _) in zip(frame, after, strict=True):
            qx, qy = a - x, b - y
            ux, uy = (c - a) / dt - vx, (d - b) / dt - vy
            gap = closest(qx, qy, ux, uy, dt) - r - robot.radius
            if gap < clearance:
                clearance, met = gap, hypot(c - a, d - b) / dt
        if scene.walls:
            gap = wall_distance(scene.walls, np.array([nx, ny])).item() - robot.radius
            if gap < clearance:
                clearance, met = gap, 0.0
        length += hypot(nx - x, ny - y)
        x, y = nx, ny
        frame = after
        path.append((x, y))
        if clearance < 0.0:
            outcome = "collided"
            break
        if hypot(scene.goal[0] - x, scene.goal[1] - y) < reach:
            outcome = "reached"
            break
    return Result(
        outcome,
        (k + 1) * dt,
        clearance,
        length,
        length / straight,
        walls,
        path,
        astray,
        met,
    )
