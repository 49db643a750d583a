"""What stands where in the signals that the navigation blocks exchange.

`robot` (5): the body's x, y [m], heading [rad], speed [m/s], turn rate [rad/s].
`obstacles` (5 each): x, y, radius [m], v_x, v_y [m/s]; a radius of zero is nothing.
`seen` (6 each): track identity, x, y, radius [m], v_x, v_y [m/s]; an identity of -1
is nothing. World frame, plane z = 0.
"""

from collections.abc import Sequence
from math import cos, sin

from systems.switching.arcs import Obstacle

CAPACITY = 24
"""Default number of obstacles that the signals have room for."""

ROBOT_EXAMPLE = [0.0, 0.0, 0.0, 0.5, 0.0]
"""A robot that drives along x."""

GOAL_EXAMPLE = [8.0, 0.0]
"""A goal ahead of it."""


def obstacles_example(capacity: int) -> list[float]:
    """One obstacle that crosses ahead of the robot, and no others."""
    return [2.0, 0.4, 0.3, 0.0, -0.3] + [0.0] * (5 * (capacity - 1))


def seen_example(capacity: int) -> list[float]:
    """The same, seen."""
    rows = [0.0, 2.0, 0.4, 0.3, 0.0, -0.3]
    return rows + [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0] * (capacity - 1)


def tracks(seen: Sequence[float]) -> list[Obstacle]:
    """The rows of `seen` that hold an obstacle."""
    found: list[Obstacle] = []
    for k in range(0, len(seen), 6):
        track, x, y, radius, vx, vy = seen[k : k + 6]
        if track >= 0.0:
            found.append((track, x, y, radius, vx, vy))
    return found


def velocity(robot: Sequence[float]) -> tuple[float, float]:
    """Velocity of the body [m/s]."""
    return robot[3] * cos(robot[2]), robot[3] * sin(robot[2])
