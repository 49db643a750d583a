"""Clusters: runs of a scan's rays that end close together, as circles.

A disc of radius R whose nearest point is r away is seen within half an angle phi with
sin phi = R / (r + R): run and range give its circle, which is widened until it holds
all points (the thesis's circumscribed one). What belongs to the grid's memory is left
out; two legs side by side are a person. The rays come in order, so that one pass over
them does what a general clustering would take a distance matrix for.
"""

from math import cos, hypot, sin
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.lidar import RAYS, STEP
from plants.turtlebot.turtlebot import RobotState
from systems.common.compiled import compiled
from systems.common.signal import reader
from systems.perception.grid import stands

MOST = 80
"""Clusters of a scan."""


class Cluster(NamedTuple):
    """A circle about some points of a scan."""

    x: float
    y: float
    radius: float
    hidden: float  # 1 if something nearer may hide a part of it
    known: float  # 1 if most of it belongs to what was there before


read_cluster = reader(Cluster)


@compiled
def circle_of(
    params: Any,
    place: RobotState,
    scan: np.ndarray,
    first: int,
    last: int,
    known: float,
) -> Cluster:
    """The circle of a run of rays, `last` included; dropouts in it do not count."""
    near = 1e9
    for k in range(first, last + 1):
        r = scan[k % RAYS, 0]
        if r > 0.0:
            near = min(near, r)
    phi = 0.5 * (last - first + 0.5) * STEP
    bearing = place.theta + 0.5 * (first + last) * STEP
    middle, n = 0.0, 0.0  # the mean of the middle third is less noisy than the nearest
    third = (last - first) // 3
    for k in range(first + third, last - third + 1):
        r = scan[k % RAYS, 0]
        if 0.0 < r < near + 0.1:
            middle, n = middle + r, n + 1.0
    near = middle / n if n > 0.0 else near
    s = min(sin(min(phi, 1.2)), 0.9)
    radius = min(near * s / (1.0 - s), params.largest * 2.0)
    d = near + radius
    x, y = place.x + d * cos(bearing), place.y + d * sin(bearing)
    for k in range(first, last + 1):
        r = scan[k % RAYS, 0]
        if r > 0.0:
            a = place.theta + k * STEP
            gap = hypot(place.x + r * cos(a) - x, place.y + r * sin(a) - y)
            radius = max(radius, gap - 0.05)
    before, after = scan[(first - 1) % RAYS, 0], scan[(last + 1) % RAYS, 0]
    hidden = 0.0 < before < near or 0.0 < after < near
    return Cluster(x, y, radius, 1.0 if hidden else 0.0, known)


@compiled
def clusters(
    params: Any, grid: np.ndarray, place: RobotState, scan: np.ndarray
) -> np.ndarray:
    """The circles of a scan, rows of `Cluster`.

    Args:
        params: A record of `TrackingParams` and of the grid's `left`, `bottom`, `cell`.
        grid: Rows of `Cell`.
        place: Where the robot is.
        scan: Rows of `Ray`.
    """
    found = np.empty((MOST, 5))
    count = 0
    # Begin behind the widest jump, so that no cluster is cut by the scan's seam.
    start, widest = 0, -1.0
    for k in range(RAYS):
        jump = abs(scan[k, 0] - scan[k - 1, 0])
        if jump > widest:
            start, widest = k, jump
    k, end = start, start + RAYS
    while k < end:
        if scan[k % RAYS, 0] == 0.0:
            k += 1
            continue
        first, last, r = k, k, scan[k % RAYS, 0]
        known = total = 0
        while k < end and k - last <= 2:  # one dropout ends no cluster
            s = scan[k % RAYS, 0]
            if s > 0.0:
                if abs(s - r) > params.jump + 2.0 * STEP * min(s, r):
                    break
                last, r = k, s
                a = place.theta + k * STEP
                total += 1
                if stands(params, grid, place.x + s * cos(a), place.y + s * sin(a)):
                    known += 1
            k += 1
        k = last + 1
        if total < 2 or count == MOST:
            continue
        old = 1.0 if 2 * known > total else 0.0
        circle = circle_of(params, place, scan, first, last, old)
        away = hypot(circle.x - place.x, circle.y - place.y)
        if circle.radius > params.largest or away > params.farthest:
            continue
        found[count, 0], found[count, 1] = circle.x, circle.y
        found[count, 2], found[count, 3] = circle.radius, circle.hidden
        found[count, 4] = circle.known
        count += 1
    return people(params, found[:count]) if params.person > 0.0 else found[:count]


@compiled
def people(params: Any, found: np.ndarray) -> np.ndarray:
    """Clusters with legs made people: two near each other are one."""
    n = len(found)
    leg = np.zeros(n, np.bool_)
    for i in range(n):
        leg[i] = found[i, 2] <= params.leg
    rows = np.empty_like(found)
    count = 0
    for i in range(n):
        if not leg[i]:
            if found[i, 2] > 0.0:
                rows[count] = found[i]
                rows[count, 2] = max(found[i, 2], params.person)
                count += 1
            continue
        mate, least = -1, params.apart
        for j in range(i + 1, n):
            gap = hypot(found[i, 0] - found[j, 0], found[i, 1] - found[j, 1])
            if leg[j] and gap < least:
                mate, least = j, gap
        rows[count] = found[i]
        rows[count, 2] = params.person
        rows[count, 3] = 1.0  # one leg hides the other, and neither is the middle
        if mate >= 0:
            leg[mate] = False
            rows[count, 0] = 0.5 * (found[i, 0] + found[mate, 0])
            rows[count, 1] = 0.5 * (found[i, 1] + found[mate, 1])
            rows[count, 3] = max(found[i, 3], found[mate, 3])
            rows[count, 4] = min(found[i, 4], found[mate, 4])
            found[mate, 2] = 0.0
        count += 1
    return rows[:count]
