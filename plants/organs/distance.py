"""Distances to organs in the control loop: a grid's value and gradient, a shaft's.

A grid's distance is interpolated between voxels. Beyond the grid it is the distance to
the organ's box, a lower bound that needs no voxel: in the control loop each look into
the memory counts.

A distance changes by no more than the way: along a shaft, steps of max(d - best + tol,
tol) miss at most tol.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from plants.organs.distance_grid import PAD
from systems.common.compiled import compiled
from systems.common.geometry import along, norm, row_of, sub
from systems.common.signal import Vector

TOLERANCE = 0.0005
"""Of a search along a shaft, m."""
ORIGIN, STEP, COUNTS, FIRST, SAFE, PLAN = 0, 3, 4, 7, 8, 9
"""Columns of an organ in `Organs.table`."""


class Organs(NamedTuple):
    """All organs as compiled functions take them.

    Attributes:
        values: All grids' voxels, one after the other, m.
        table: An organ a row: its grid's origin in W at rest, spacing, counts of
            voxels, place in `values`; the distances of R's axis that are held and
            planned with, m.
        moved: An organ a row: its displacement in m, its velocity in m/s (n, 6).
    """

    values: np.ndarray
    table: np.ndarray
    moved: np.ndarray


@compiled
def distance(organs: Organs, k: int, p: Vector) -> float:
    """From the point p to the surface of the organ k, m; negative inside."""
    row, moved, values = organs.table[k], organs.moved[k], organs.values
    nx, ny, nz = int(row[4]), int(row[5]), int(row[6])
    h = row[STEP]
    x = (p[0] - moved[0] - row[0]) / h
    y = (p[1] - moved[1] - row[1]) / h
    z = (p[2] - moved[2] - row[2]) / h
    if not (0.0 <= x <= nx - 1.0 and 0.0 <= y <= ny - 1.0 and 0.0 <= z <= nz - 1.0):
        pad = PAD / h
        x = max(pad - x, x - (nx - 1.0) + pad, 0.0)
        y = max(pad - y, y - (ny - 1.0) + pad, 0.0)
        z = max(pad - z, z - (nz - 1.0) + pad, 0.0)
        return h * sqrt(x * x + y * y + z * z)
    i, j, m = min(int(x), nx - 2), min(int(y), ny - 2), min(int(z), nz - 2)
    a, b, c = x - i, y - j, z - m
    at = int(row[FIRST]) + (i * ny + j) * nz + m
    up = at + nz
    low = (values[at] * (1.0 - c) + values[at + 1] * c) * (1.0 - b)
    low += (values[up] * (1.0 - c) + values[up + 1] * c) * b
    at += ny * nz
    up += ny * nz
    high = (values[at] * (1.0 - c) + values[at + 1] * c) * (1.0 - b)
    high += (values[up] * (1.0 - c) + values[up + 1] * c) * b
    return low * (1.0 - a) + high * a


@compiled
def normal(organs: Organs, k: int, p: Vector) -> Vector:
    """Unit vector away from the organ k at p: central differences over a voxel."""
    h = 0.5 * organs.table[k, STEP]
    x, y, z = p
    gx = distance(organs, k, (x + h, y, z)) - distance(organs, k, (x - h, y, z))
    gy = distance(organs, k, (x, y + h, z)) - distance(organs, k, (x, y - h, z))
    gz = distance(organs, k, (x, y, z + h)) - distance(organs, k, (x, y, z - h))
    length = sqrt(gx * gx + gy * gy + gz * gz)
    if length < 1e-9:
        return 0.0, 0.0, 1.0
    return gx / length, gy / length, gz / length


@compiled
def velocity(organs: Organs, k: int) -> Vector:
    """Of the organ k, m/s."""
    moved = organs.moved[k]
    return moved[3], moved[4], moved[5]


@compiled
def shaft_distance(
    organs: Organs, k: int, a: Vector, b: Vector, within: float
) -> tuple[float, float]:
    """Least distance of the organ k from the segment a to b, and where, in [0, 1].

    Args:
        organs: The organs.
        k: Which of them.
        a: One end, m.
        b: The other one, m.
        within: What is farther, m, is of no interest: it may be said too far.
    """
    d = sub(b, a)
    length = norm(d)
    best, s_best, t = 1e9, 1.0, 0.0
    while True:
        s = 1.0 - t / length if length > 0.0 else 1.0
        here = distance(organs, k, along(a, s, d))
        if here < best:
            best, s_best = here, s
        if t >= length:
            return best, s_best
        step = max(here - min(best, within) + TOLERANCE, TOLERANCE)
        t = min(t + step, length)


@compiled
def clear_depth(
    organs: Organs, keep: np.ndarray, g: Vector, u: Vector, most: float
) -> float:
    """First depth at which the ray from g along u comes too near to an organ, m.

    Args:
        organs: The organs.
        keep: How near each is too near (n), m.
        g: Where the ray begins, m.
        u: Its direction.
        most: It is followed so far, m.

    Returns:
        R: a straight tool through g is free at all depths below it; `most` if the
        whole ray is.
    """
    t = 0.0
    while t < most:
        p = along(g, t, u)
        room = 1e9
        for k in range(len(organs.table)):
            room = min(room, distance(organs, k, p) - keep[k])
        if room <= 0.0:
            return t
        t += max(room, TOLERANCE)
    return most


@compiled
def distances(organs: Organs, k: int, points: np.ndarray) -> np.ndarray:
    """Of many points (n, 3), m (n)."""
    found = np.empty(len(points))
    for i in range(len(points)):
        found[i] = distance(organs, k, row_of(points, i))
    return found
