"""The dynamic window approach, a peer of our own making.

D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision avoidance", IEEE
Robotics & Automation Magazine 4(1), 1997, with the weights and the way out of a stall
of PythonRobotics: with those of the paper it stands before whatever is on its way.
Obstacles are carried on with their velocities, which neither does: without that it
would be beaten by anything that moves.
"""

from math import cos, hypot, inf, pi, sin

import numpy as np

from tests.benchmarks.navigation_loop import Command, Now, Step
from tests.benchmarks.navigation_scenes import Robot, Scene

HEADING, CLEARANCE, SPEED = 0.15, 1.0, 1.0
"""Costs of an angle to the goal [1/rad], an inverse distance [m], what lacks of the
speed [s/m]."""
WINDOW, HORIZON = 0.25, 3.0
"""Within what time speeds must be reached, and how far arcs are looked at [s]."""
TIMES = np.arange(0.2, HORIZON + 0.1, 0.2)
NEAREST = 30
"""So many obstacles count."""
STUCK = 0.001
"""A speed [m/s] that is none: the body turns on the spot."""


def arcs(robot: Robot, now: Now, rate: float) -> tuple[np.ndarray, ...]:
    """Candidates (n, 2): speed and turn rate, or v_x and v_y of a body without limits.

    Also their places x, y and headings, (n, times) each.
    """
    if robot.holonomic:
        speed, theta = np.meshgrid(
            np.linspace(0.0, robot.speed, 5), np.linspace(-pi, pi, 24, endpoint=False)
        )
        u, v = (speed * np.cos(theta)).ravel(), (speed * np.sin(theta)).ravel()
        x, y = now.x + u[:, None] * TIMES, now.y + v[:, None] * TIMES
        theta = np.repeat(theta.ravel()[:, None], len(TIMES), axis=1)
        return np.column_stack([u, v]), x, y, theta
    speed = now.vx * cos(now.theta) + now.vy * sin(now.theta)
    dv, dw = robot.acceleration * WINDOW, robot.turn_acceleration * WINDOW
    low, high = max(speed - dv, 0.0), min(max(speed + dv, 0.0), robot.speed)
    right, left = max(rate - dw, -robot.turn_rate), min(rate + dw, robot.turn_rate)
    v, w = (
        part.ravel()
        for part in np.meshgrid(np.linspace(low, high, 6), np.linspace(right, left, 15))
    )
    turn = np.where(np.abs(w) < 1e-6, 1e-6, w)[:, None]
    theta = now.theta + turn * TIMES
    x = now.x + v[:, None] / turn * (np.sin(theta) - sin(now.theta))
    y = now.y - v[:, None] / turn * (np.cos(theta) - cos(now.theta))
    return np.column_stack([v, w]), x, y, theta


def dynamic_window(margin: float, scene: Scene) -> Step:
    """The planner for a scene; it keeps `margin` [m] from obstacles' surfaces."""
    robot, rate = scene.robot, 0.0

    def step(now: Now) -> Command:
        nonlocal rate
        chosen, x, y, theta = arcs(robot, now, rate)
        seen = np.reshape(np.array(now.seen, float), (-1, 6))[:, 1:]
        order = np.argsort(np.hypot(seen[:, 0] - now.x, seen[:, 1] - now.y))
        a, b, r, u, v = seen[order[:NEAREST]].T[:, :, None]
        qx, qy = (a + u * TIMES)[:, None] - x, (b + v * TIMES)[:, None] - y
        gaps = np.hypot(qx, qy) - r[:, None] - robot.radius - margin
        gap = gaps.min(axis=(0, 2), initial=inf)
        # The heading when the goal is nearest, or at the arc's end.
        gx, gy = scene.goal[0] - x, scene.goal[1] - y
        end = np.hypot(gx, gy).argmin(axis=1)
        at = np.arange(len(chosen)), end
        away = np.abs((np.arctan2(gy[at], gx[at]) - theta[at] + pi) % (2 * pi) - pi)
        pace = np.hypot(*chosen.T) if robot.holonomic else chosen[:, 0]
        cost = HEADING * away + SPEED * (robot.speed - pace)
        cost += CLEARANCE / np.maximum(gap + robot.radius + margin, 1e-3)
        best = np.where(gap > 0.0, cost, 1e3 - gap).argmin()
        if robot.holonomic:
            u, v = chosen[best].tolist()
            return u, v, False
        speed, rate = chosen[best].tolist()
        if max(speed, hypot(now.vx, now.vy)) < STUCK:
            rate = -robot.turn_rate
        return *_wanted(robot, now.theta, speed, rate), False

    return step


def _wanted(
    robot: Robot, theta: float, speed: float, rate: float
) -> tuple[float, float]:
    """The velocity that the common control law answers by a speed and a turn rate."""
    error = max(abs(rate) / 4.0, rate * rate / (2.0 * robot.turn_acceleration))
    heading = theta + (error if rate > 0.0 else -error)
    size = max(speed / cos(error), 1e-3)
    return size * cos(heading), size * sin(heading)
