"""How obstacles move: standing, straight on, bouncing in a box, along waypoints.

Every motion is a closed function of time, so that nothing drifts.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from plants.crowd.signals import CAPACITY, OBSTACLES, Obstacle, filled
from systems.common.block import Block
from systems.common.parameter import Rules, check, parameter

MOTIONS = ("straight", "bouncing", "waypoints")
FAR = {"least": -100.0, "most": 100.0}
"""Bounds of a place [m]."""


@dataclass
class ObstacleParams:
    """One obstacle: a disc, and how it moves."""

    motion: str = parameter("straight", "how it moves", choices=MOTIONS)
    radius: float = parameter(0.3, "R_i", "m", above=0.0, most=10.0)
    start: list[float] = parameter(
        [2.0, 0.4], "centre x, y at time zero", "m", shape=(2,), **FAR
    )
    velocity: list[float] = parameter(
        [0.0, 0.0],
        "of a straight or bouncing one at time zero",
        "m/s",
        shape=(2,),
        least=-5.0,
        most=5.0,
    )
    box: list[float] = parameter(
        [0.0, -5.0, 10.0, 5.0],
        "of a bouncing one: least x, least y, greatest x, greatest y",
        "m",
        shape=(4,),
        **FAR,
    )
    times: list[float] = parameter(
        [],
        "when one that follows waypoints is at each; it stands before and after",
        "s",
        shape=(-1,),
        least=0.0,
        most=1e4,
    )
    points: list[list[float]] = parameter(
        [], "its waypoints x, y", "m", shape=(-1, 2), **FAR
    )

    guided: str | None = parameter(
        None, "tape `t,x,y` of where somebody drove it; '': live", file=True
    )

    def rules(self) -> Rules:
        """Waypoints come one after the other; a bouncing one starts in its box."""
        if self.motion == "waypoints":
            count = len(self.points)
            rising = all(a < b for a, b in pairwise(self.times))
            paired = 0 < len(self.times) == count and rising
            yield paired, "times", f"as many rising times as points, {count}"
        if self.motion == "bouncing":
            r = self.radius
            for axis, x in enumerate(self.start):
                low, high = self.box[axis] + r, self.box[axis + 2] - r
                told = f"its {'xy'[axis]} in the box, a radius from the walls: "
                yield low <= x <= high and low < high, "start", f"{told}[{low}, {high}]"


def _bounce(x: float, v: float, low: float, high: float) -> tuple[float, float]:
    """Folds a straight motion back into [low, high]."""
    span = high - low
    phase = (x - low) % (2.0 * span)
    if phase <= span:
        return low + phase, v
    return low + 2.0 * span - phase, -v


def obstacle_at(params: ObstacleParams, t: float) -> Obstacle:
    """An obstacle at a time [s]."""
    r = params.radius
    if params.motion == "waypoints":
        times, points = params.times, params.points
        k = bisect_right(times, t)
        if k == 0 or k == len(times):
            x, y = points[min(k, len(times) - 1)]
            return Obstacle(x, y, r, 0.0, 0.0)
        span = times[k] - times[k - 1]
        s = (t - times[k - 1]) / span
        (ax, ay), (bx, by) = points[k - 1], points[k]
        place = ax + s * (bx - ax), ay + s * (by - ay)
        return Obstacle(*place, r, (bx - ax) / span, (by - ay) / span)
    (x, y), (vx, vy) = params.start, params.velocity
    x, y = x + t * vx, y + t * vy
    if params.motion == "bouncing":
        least_x, least_y, most_x, most_y = params.box
        x, vx = _bounce(x, vx, least_x + r, most_x - r)
        y, vy = _bounce(y, vy, least_y + r, most_y - r)
    return Obstacle(x, y, r, vx, vy)


class ObstacleMotion(Block):
    """Moves the obstacles of a scenario; they take no notice of the robot.

    Port ``obstacles`` emits them, rows of `Obstacle`.
    """

    def __init__(self, obstacles: Sequence[ObstacleParams] | None = None) -> None:
        """Makes the block.

        Args:
            obstacles: May be none; one of the defaults if None.

        Raises:
            ParameterError: If an obstacle makes no sense.
            ValueError: If there are too many.
        """
        super().__init__()
        self.obstacles = [ObstacleParams()] if obstacles is None else [*obstacles]
        for index, obstacle in enumerate(self.obstacles):
            check(obstacle, f"obstacles[{index}]")
        if len(self.obstacles) > CAPACITY:
            raise ValueError(
                f"obstacles: {len(self.obstacles)} of them: expected <= {CAPACITY}"
            )
        self.signal_out(
            "obstacles", OBSTACLES, self._calc_obstacles, {self.time_ticket()}
        )

    def _calc_obstacles(self, context: Any) -> np.ndarray:
        t = context.get_time()
        return filled([obstacle_at(params, t) for params in self.obstacles])
