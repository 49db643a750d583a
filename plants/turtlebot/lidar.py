"""A planar lidar: the range of every ray to what it meets first, with its faults.

What a ray meets is a disc, a leg of a person, or a wall; the nearest hides the rest. A
TurtleBot 3's LDS-02 sees 8 m, a TurtleBot 4's RPLIDAR A1 12 m, with a ray a degree.
"""

from dataclasses import dataclass
from math import asin, atan2, ceil, cos, floor, hypot, inf, pi, sin, sqrt
from statistics import NormalDist
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.crowd.signals import OBSTACLES, Obstacle
from plants.crowd.walls import segments
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Many, reader
from systems.common.step_block import StepBlock

RAYS = 360
"""Of a turn, the first straight ahead, counter-clockwise."""
STEP = 2.0 * pi / RAYS
COSINES, SINES = np.cos(STEP * np.arange(RAYS)), np.sin(STEP * np.arange(RAYS))
ASTRIDE, STRIDE, SWING = 0.11, 1.2, 0.25
"""Of a person's legs, in m: from the middle; of two steps; forwards and backwards at a
walker's 1.3 m/s, less when slower."""
read_obstacle = reader(Obstacle)


class Ray(NamedTuple):
    """What a ray of the lidar tells."""

    r: Annotated[float, Field("m", "to what it meets; 0 if nothing comes back", 3.0)]


class RayNoise(NamedTuple):
    """What a ray is wrong by, in standard deviations."""

    r: Annotated[float, Field("1", "of its range", 0.5)]
    loss: Annotated[float, Field("1", "below the dropouts' quantile it is lost", 0.5)]


ROWS = tuple(map(str, range(RAYS)))
SCAN = Many(Ray, ROWS)
SCAN_NOISE = Many(RayNoise, ROWS)


@dataclass
class LidarParams:
    """A planar lidar; the defaults are an RPLIDAR A1's."""

    reach: float = parameter(
        12.0, "of a ray, beyond which nothing comes back", "m", least=1.0, most=100.0
    )
    noise: float = parameter(
        0.01, "standard deviation of a range", "m", least=0.0, most=0.2
    )
    dropout: float = parameter(
        0.01, "share of rays that come back to no avail", least=0.0, most=0.5
    )
    legs: bool = parameter(False, "whether obstacles are people, seen at their legs")
    leg: float = parameter(0.06, "radius of a leg", "m", least=0.02, most=0.2)


@compiled
def ray(c: float, s: float, k: int) -> tuple[float, float]:
    """Direction of a ray, by cosine and sine of the lidar's heading."""
    a, b = COSINES[k % RAYS], SINES[k % RAYS]
    return c * a - s * b, s * a + c * b


@compiled
def _meet(
    ranges: np.ndarray, theta: float, qx: float, qy: float, radius: float
) -> None:
    """Shortens the rays that meet a disc at q from the lidar."""
    d = hypot(qx, qy)
    if d <= radius:
        ranges[:] = 0.01
        return
    alpha = asin(radius / d)
    beta = atan2(qy, qx) - theta
    for k in range(ceil((beta - alpha) / STEP), floor((beta + alpha) / STEP) + 1):
        phi = k * STEP - beta
        across = d * sin(phi)
        r = d * cos(phi) - sqrt(max(radius * radius - across * across, 0.0))
        ranges[k % RAYS] = min(ranges[k % RAYS], r)


@compiled
def scan_of(
    params: Any, robot: RobotState, obstacles: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray]:
    """A scan from where the robot is.

    Args:
        params: A record of `LidarParams` and `walls`, see `segments`; `lost`, the
            quantile below which a ray is.
        robot: The body, with the lidar at its centre.
        obstacles: Rows of `Obstacle`.
        noise: Rows of `RayNoise`.

    Returns:
        Rows of `Ray`.
    """
    ranges = np.full(RAYS, inf)
    for i in range(len(obstacles)):
        o = read_obstacle(obstacles[i])
        qx, qy = o.x - robot.x, o.y - robot.y
        if o.radius <= 0.0:
            continue
        if not params.legs:
            _meet(ranges, robot.theta, qx, qy, o.radius)
            continue
        v = hypot(o.v_x, o.v_y)
        hx, hy = (o.v_x / v, o.v_y / v) if v > 1e-3 else (1.0, 0.0)
        # Feet stand while the body goes on: the phase is that of the way.
        way = sin(2.0 * pi * (o.x * hx + o.y * hy) / STRIDE + 2.4 * i)
        swing = way * SWING * min(v / 1.3, 1.0)
        for side in (1.0, -1.0):
            lx = qx + side * (swing * hx - ASTRIDE * hy)
            ly = qy + side * (swing * hy + ASTRIDE * hx)
            _meet(ranges, robot.theta, lx, ly, params.leg)
    ahead, across = cos(robot.theta), sin(robot.theta)
    for i in range(len(params.walls)):
        ax, ay = params.walls[i, 0] - robot.x, params.walls[i, 1] - robot.y
        ex, ey = params.walls[i, 2] - robot.x - ax, params.walls[i, 3] - robot.y - ay
        if ex == 0.0 and ey == 0.0:
            continue
        for k in range(RAYS):
            c, s = ray(ahead, across, k)
            along = c * ey - s * ex
            if along != 0.0:
                r, share = (ax * ey - ay * ex) / along, (ax * s - ay * c) / along
                if r > 0.0 and 0.0 <= share <= 1.0:
                    ranges[k] = min(ranges[k], r)
    told = np.zeros((RAYS, 1))
    for k in range(RAYS):
        if ranges[k] <= params.reach and noise[k, 1] >= params.lost:
            told[k, 0] = max(ranges[k] + params.noise * noise[k, 0], 0.01)
    return (told,)


class Lidar(StepBlock):
    """Scans the floor about the robot.

    Port ``robot`` accepts the `RobotState`.
    Port ``obstacles`` accepts rows of `Obstacle`.
    Port ``noise`` accepts rows of `RayNoise`.
    Port ``scan`` emits rows of `Ray`.
    """

    def __init__(
        self, params: LidarParams | None = None, walls: np.ndarray | None = None
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            walls: What stands, as `segments` gives it.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.declare_map(
            scan_of,
            [constants(params or LidarParams(), walls)],
            {"robot": RobotState, "obstacles": OBSTACLES, "noise": SCAN_NOISE},
            "scan",
            SCAN,
        )


def constants(params: LidarParams, walls: np.ndarray | None = None) -> np.ndarray:
    """The parameters as `scan_of` takes them."""
    check(params, "lidar")
    lost = NormalDist().inv_cdf(params.dropout) if params.dropout > 0.0 else -1e9
    walls = segments([]) if walls is None else walls
    return packed(params, walls=walls, lost=lost)
