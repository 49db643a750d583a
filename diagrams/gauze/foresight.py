"""Whether a robot that knew the future could have kept clear: the peer of a planner.

It withdraws at once, as fast as R may, to its least insertion, turns there to a
direction that it chooses knowing all that is to come, and stays. Where even that
touches for every direction, the scene is called unavoidable. It is a bound on one side:
a scene that it survives could be avoided; one that it does not might still be survived
by a robot that comes and goes.
"""

from math import acos, cos, pi, sin
from typing import NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import (
    Vector,
    along,
    closest_points,
    dot,
    norm,
    scaled,
    sub,
    unit,
    xyz,
)


class Reach(NamedTuple):
    """What the robot can: speeds in m/s and rad/s, m/s^2, insertion in m."""

    speed: float
    acceleration: float
    turning: float
    least_insertion: float
    max_tilt: float


@compiled
def touches(
    reach: Reach,
    contact: float,
    times: np.ndarray,
    g: Vector,
    start: Vector,
    tips: np.ndarray,
    fulcrums: np.ndarray,
    aim: Vector,
) -> bool:
    """Whether R is touched that withdraws at once and then turns to a direction.

    Args:
        reach: What it can.
        contact: Distance of the axes at contact, m.
        times: In s, (n).
        g: Its fulcrum, m.
        start: Its tip at first, m.
        tips: Of the tools over time, m (n, tools, 3).
        fulcrums: Of the tools, likewise.
        aim: The direction, a unit vector.
    """
    shaft = sub(start, g)
    first, u0 = norm(shaft), unit(shaft)
    way = max(0.0, first - reach.least_insertion)
    ramp = reach.speed / reach.acceleration
    angle = acos(min(1.0, max(-1.0, dot(u0, aim))))
    done = way / reach.speed + ramp
    for k in range(len(times)):
        t = times[k] - times[0]
        gone = (
            0.5 * reach.acceleration * t * t
            if t < ramp
            else reach.speed * (t - 0.5 * ramp)
        )
        q = first - min(way, gone)
        share = 0.0
        if t > done and angle > 1e-9:
            share = min(1.0, reach.turning * (t - done) / angle)
        u = unit(along(scaled(1.0 - share, u0), share, aim))
        p = along(g, q, u)
        for i in range(tips.shape[1]):
            near = closest_points(g, p, xyz(fulcrums[k, i], 0), xyz(tips[k, i], 0))
            if near.distance < contact:
                return True
    return False


def unavoidable(
    reach: Reach,
    contact: float,
    times: np.ndarray,
    g: Vector,
    start: Vector,
    tips: np.ndarray,
    fulcrums: np.ndarray,
) -> bool:
    """Whether R is touched in spite of knowing the future; see `touches`."""
    aims = [unit(sub(start, g))]
    for tilt in np.linspace(0.0, min(reach.max_tilt, 1.2), 4)[1:]:
        for azimuth in np.linspace(0.0, 2.0 * pi, 8, endpoint=False):
            across = sin(tilt)
            aims.append((across * cos(azimuth), across * sin(azimuth), -cos(tilt)))
    aims.append((0.0, 0.0, -1.0))
    told = (reach, contact, times, g, start, tips, fulcrums)
    return all(touches(*told, aim) for aim in aims)
