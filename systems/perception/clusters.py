"""Clusters: runs of a scan's rays that end close together, as circles.

A disc of radius R whose nearest point is r away is seen within half an angle phi with
sin phi = R / (r + R): run and range give its circle, which is widened until it holds
all points (the thesis's circumscribed one). What belongs to the grid's memory is left
out; two legs side by side are a person. The rays come in order, so that one pass over
them does what a general clustering would take a distance matrix for.
"""

from math import asin, atan2, cos, hypot, pi, sin
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.lidar import RAYS, STEP, ray
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled
from systems.common.signal import reader, row_writer, size
from systems.perception.grid import RELIABLE, SETTLED, stands

CUSP = 0.05
"""Depth of a notch between two things [m]: a body bulges, it has none."""
MOST = 80
"""Clusters of a scan."""


SEEN, RIGHT, LEFT, BETWEEN, LEG = range(5)
"""What something nearer hides of a cluster: nothing, its right, its left, both; of a
person one leg."""


class Cluster(NamedTuple):
    """A circle about some points of a scan."""

    x: float
    y: float
    radius: float
    hidden: float  # one of the above
    known: float  # 1 if most of it was there before, 2 if it was for long
    near: float  # range of its nearest part, m
    right: float  # bearings of its ends in the world, rad
    left: float
    cut: float  # 1 if another begins where it ends
    legs: float  # 1 if it is a person's, seen by one or both


read_cluster, write_cluster = reader(Cluster), row_writer(Cluster)
CLUSTER_SIZE = size(Cluster)


@compiled
def circle_of(
    params: Any,
    place: RobotState,
    scan: np.ndarray,
    first: int,
    last: int,
    known: float,
    cut: float,
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
    ahead, across = cos(place.theta), sin(place.theta)
    for k in range(first, last + 1):
        r = scan[k % RAYS, 0]
        if radius > params.largest:
            break  # it is none that moves, and would only grow
        if r > 0.0:
            ex, ey = ray(ahead, across, k)
            gap = hypot(place.x + r * ex - x, place.y + r * ey - y)
            radius = max(radius, gap - 0.05)
    before, after = scan[(first - 1) % RAYS, 0], scan[(last + 1) % RAYS, 0]
    hidden = 1.0 * (0.0 < before < near) + 2.0 * (0.0 < after < near)
    right = place.theta + (first - 0.25) * STEP
    left = place.theta + (last + 0.25) * STEP
    return Cluster(x, y, radius, hidden, known, near, right, left, cut, 0.0)


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
    found = np.empty((MOST, CLUSTER_SIZE))
    count = 0
    # Begin behind the widest jump, so that no cluster is cut by the scan's seam.
    start, widest = 0, -1.0
    for k in range(RAYS):
        jump = abs(scan[k, 0] - scan[k - 1, 0])
        if jump > widest:
            start, widest = k, jump
    ahead, across = cos(place.theta), sin(place.theta)
    k, end, touches = start, start + RAYS, False
    while k < end:
        if scan[k % RAYS, 0] == 0.0:
            k += 1
            continue
        first, last, r = k, k, scan[k % RAYS, 0]
        known = total = sure = 0
        low, peak, cusp = r, r, k
        cut, touches = touches, False
        while k < end and k - last <= 2:  # one dropout ends no cluster
            s = scan[k % RAYS, 0]
            if s > 0.0:
                if abs(s - r) > params.jump + 2.0 * STEP * min(s, r):
                    break
                if peak - low > CUSP and peak - s > CUSP:
                    last = cusp  # two that touch, or the corner of a room
                    cut = touches = True
                    break
                if s < low:
                    low, peak, cusp = s, s, k
                elif s > peak:
                    peak, cusp = s, k
                last, r = k, s
                ex, ey = ray(ahead, across, k)
                total += 1
                odds = stands(params, grid, place.x + s * ex, place.y + s * ey)
                known += 1 if odds >= SETTLED else 0
                sure += 1 if odds >= RELIABLE else 0
            k += 1
        k = last + 1
        if total < 2 or count == MOST:
            continue
        old = 1.0 * (2 * known > total) + 1.0 * (2 * sure > total)
        circle = circle_of(params, place, scan, first, last, old, 1.0 * cut)
        away = hypot(circle.x - place.x, circle.y - place.y)
        if circle.radius > params.largest or away > params.farthest:
            continue
        write_cluster(found, count, circle)
        count += 1
    return people(params, found[:count]) if params.person > 0.0 else found[:count]


@compiled
def pairs(params: Any, found: np.ndarray, leg: np.ndarray) -> np.ndarray:
    """Of each leg the other one, -1 for none: those nearest to each other first."""
    n = len(found)
    gaps = np.full((n, n), params.apart)
    for i in range(n):
        for j in range(i + 1, n):
            if leg[i] and leg[j]:
                c, o = read_cluster(found[i]), read_cluster(found[j])
                gaps[i, j] = hypot(c.x - o.x, c.y - o.y)
    mates = np.full(n, -1)
    while n > 0:
        k = int(gaps.argmin())
        i, j = k // n, k % n
        if gaps[i, j] >= params.apart:
            break
        mates[i], mates[j] = j, i
        gaps[i, :] = gaps[j, :] = gaps[:, i] = gaps[:, j] = params.apart
    return mates


@compiled
def people(params: Any, found: np.ndarray) -> np.ndarray:
    """Clusters with legs made people: two near each other are one."""
    n = len(found)
    leg = np.zeros(n, np.bool_)
    for i in range(n):
        leg[i] = read_cluster(found[i]).radius <= params.leg
    mates = pairs(params, found, leg)
    rows = np.empty_like(found)
    count = 0
    for i in range(n):
        c = read_cluster(found[i])
        if c.radius == 0.0:
            continue  # a second leg
        mate = int(mates[i])
        x, y, hidden, known = c.x, c.y, c.hidden, c.known
        if mate > i:
            o = read_cluster(found[mate])
            x, y, known = 0.5 * (x + o.x), 0.5 * (y + o.y), min(known, o.known)
            hidden = 1.0 * SEEN
            nobody = Cluster(o.x, o.y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            write_cluster(found, mate, nobody)
        elif leg[i]:
            hidden = 1.0 * LEG
        radius = max(c.radius, params.person)
        ends = (c.near, c.right, c.left, c.cut, 1.0 * leg[i])
        person = Cluster(x, y, radius, hidden, known, *ends)
        write_cluster(rows, count, person)
        count += 1
    return rows[:count]


@compiled
def seen_as(
    params: Any, place: RobotState, c: Cluster, x: float, y: float, radius: float
) -> tuple[float, float, float]:
    """Where a cluster's circle is if it is a part of a known one, and how sure.

    What is half hidden is a tangent to the other half, not a smaller circle.

    Args:
        params: A record of `TrackingParams`.
        place: Where the robot is.
        c: The cluster.
        x: Of the known circle [m].
        y: Of the known circle [m].
        radius: Of the known circle [m].

    Returns:
        x, y, and the standard deviation [m].
    """
    if c.hidden == SEEN:
        return c.x, c.y, params.noise
    if c.hidden == LEG:  # he is beside it, where he was thought to be if that may be
        d = hypot(x - c.x, y - c.y)
        share = min(params.beside / d, 1.0) if d > 0.0 else 0.0
        return c.x + share * (x - c.x), c.y + share * (y - c.y), params.hidden_noise
    if c.radius >= radius:
        return c.x, c.y, params.hidden_noise
    d = c.near + radius
    phi = asin(radius / d)
    if c.hidden == RIGHT:
        bearing = c.left - phi
    elif c.hidden == LEFT:
        bearing = c.right + phi
    else:  # it is as far across as it was thought to be, and covers what is seen
        low, wide = c.left - phi, max(c.right - c.left + 2.0 * phi, 0.0)
        off = (atan2(y - place.y, x - place.x) - low + pi) % (2.0 * pi) - pi
        bearing = low + min(max(off, 0.0), wide)
    x, y = place.x + d * cos(bearing), place.y + d * sin(bearing)
    return x, y, 0.5 * (params.noise + params.hidden_noise)
