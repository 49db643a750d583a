"""How obstacles move: standing, straight on, bouncing in a box, along waypoints.

Every motion is a closed function of time, so that nothing drifts.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from systems.common.block import Block
from systems.switching.signals import CAPACITY

MOTIONS = ("straight", "bouncing", "waypoints")


@dataclass
class ObstacleParams:
    """One obstacle: a disc, and how it moves."""

    # One of MOTIONS.
    motion: str = "straight"
    # Radius R_i [m].
    radius: float = 0.3
    # Centre at time zero [m].
    start: list[float] = field(default_factory=lambda: [2.0, 0.4])
    # Velocity of a straight or bouncing one at time zero [m/s].
    velocity: list[float] = field(default_factory=lambda: [0.0, 0.0])
    # Box of a bouncing one: least x, least y, greatest x, greatest y [m].
    box: list[float] = field(default_factory=lambda: [0.0, -5.0, 10.0, 5.0])
    # Of one that follows waypoints: times [s] and points [m]; still before and after.
    times: list[float] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)

    def check(self, name: str = "obstacle") -> None:
        """Checks the values.

        Args:
            name: The obstacle's, for the message.

        Raises:
            ValueError: If one makes no sense; tells what was expected.
        """
        if self.motion not in MOTIONS:
            raise ValueError(
                f"{name}: motion={self.motion!r} must be one of {', '.join(MOTIONS)}"
            )
        if not (self.radius > 0.0 and isfinite(self.radius)):
            raise ValueError(f"{name}: radius={self.radius} m must be positive")
        numbers = [*self.start, *self.velocity, *self.box, *self.times]
        numbers += [x for point in self.points for x in point]
        if not all(isfinite(x) for x in numbers):
            raise ValueError(f"{name}: a position, velocity or time is not finite")
        sizes = (len(self.start), len(self.velocity), len(self.box))
        if sizes != (2, 2, 4) or any(len(point) != 2 for point in self.points):
            raise ValueError(
                f"{name}: start, velocity and points need 2 numbers, box needs 4"
            )
        if self.motion == "waypoints":
            rising = all(a < b for a, b in zip(self.times, self.times[1:]))  # noqa: B905
            if len(self.times) != len(self.points) or not self.times or not rising:
                raise ValueError(
                    f"{name}: waypoints need as many rising times as points, got "
                    f"{len(self.times)} times and {len(self.points)} points"
                )
        if self.motion == "bouncing":
            for axis in range(2):
                low, high = self.box[axis] + self.radius, self.box[axis + 2]
                high -= self.radius
                if not low <= self.start[axis] <= high or low == high:
                    raise ValueError(
                        f"{name}: start={self.start} must lie in its box, a radius "
                        f"from the walls: [{low}, {high}] along axis {axis}"
                    )


def _bounce(x: float, v: float, low: float, high: float) -> tuple[float, float]:
    """Folds a straight motion back into [low, high]."""
    span = high - low
    phase = (x - low) % (2.0 * span)
    if phase <= span:
        return low + phase, v
    return low + 2.0 * span - phase, -v


def place_and_velocity(
    obstacle: ObstacleParams, t: float
) -> tuple[float, float, float, float]:
    """Centre x, y [m] and velocity v_x, v_y [m/s] at a time [s]."""
    if obstacle.motion == "waypoints":
        times, points = obstacle.times, obstacle.points
        k = bisect_right(times, t)
        if k == 0 or k == len(times):
            x, y = points[min(k, len(times) - 1)]
            return x, y, 0.0, 0.0
        span = times[k] - times[k - 1]
        s = (t - times[k - 1]) / span
        (ax, ay), (bx, by) = points[k - 1], points[k]
        return (
            ax + s * (bx - ax),
            ay + s * (by - ay),
            (bx - ax) / span,
            (by - ay) / span,
        )
    (x, y), (vx, vy) = obstacle.start, obstacle.velocity
    x, y = x + t * vx, y + t * vy
    if obstacle.motion == "bouncing":
        r, box = obstacle.radius, obstacle.box
        x, vx = _bounce(x, vx, box[0] + r, box[2] - r)
        y, vy = _bounce(y, vy, box[1] + r, box[3] - r)
    return x, y, vx, vy


class ObstacleMotion(Block):
    """Moves the obstacles of a scenario; they take no notice of the robot.

    Port ``obstacles`` emits x, y, radius, v_x, v_y of each obstacle, world frame
    (5 each; radius zero for none).
    """

    def __init__(
        self,
        obstacles: Sequence[ObstacleParams] | None = None,
        capacity: int = CAPACITY,
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If an obstacle makes no sense, or there are too many.
        """
        super().__init__()
        self.obstacles = list(obstacles or [ObstacleParams()])
        for index, obstacle in enumerate(self.obstacles):
            obstacle.check(f"obstacles[{index}]")
        if len(self.obstacles) > capacity:
            raise ValueError(
                f"{len(self.obstacles)} obstacles: expected at most {capacity}"
            )
        self._capacity = capacity
        self.vector_out(
            "obstacles", 5 * capacity, self._calc_obstacles, {self.time_ticket()}
        )

    def _calc_obstacles(self, context: Any) -> Sequence[float]:
        t = context.get_time()
        rows: list[float] = []
        for obstacle in self.obstacles:
            x, y, vx, vy = place_and_velocity(obstacle, t)
            rows += [x, y, obstacle.radius, vx, vy]
        return rows + [0.0] * (5 * self._capacity - len(rows))
