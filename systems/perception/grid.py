"""The occupancy grid: what rays hit and what they pass, cell by cell.

A cell holds the logarithm of the odds that something stands in it, and the mean of
the points that were hit there: what stands is known to a centimetre, not to a cell.
What walks is left out. A cell is forgotten only if rays pass through its mean.
"""

from math import atan2, cos, floor, hypot, sin
from typing import Any

import numpy as np

from plants.turtlebot.lidar import RAYS, STEP, ray
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled
from systems.perception.signals import CELLS
from systems.switching.signals import STANDING

HIT, MISS = 0.9, -1.2
"""What a scan adds to the logarithm of the odds."""
THROUGH = 0.025
"""A ray passes through what is this near to it [m]; along a wall it goes beside it."""
SHORT = 0.2
"""So much before what it hits a ray passes through nothing any more [m]."""
LEAST, MOST = -4.0, 27.0
OCCUPIED = 1.7
"""Two hits more than passes: something stands there."""
SETTLED = 4.0
"""Five hits: nothing new."""
RELIABLE = 18.0
"""Twenty hits: so long has it stood that the robot finds its place by it."""
AROUND = (0, *(i * CELLS + j for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j))
"""From a cell to itself and its neighbours."""
NEAR = 1.5
"""Within this distance [m] every point matters, beyond it one of four cells."""


@compiled
def cell_of(params: Any, x: float, y: float) -> int:
    """Index of the cell at a place; -1 beyond the grid."""
    i = floor((x - params.left) / params.cell)
    j = floor((y - params.bottom) / params.cell)
    return i * CELLS + j if 0 <= i < CELLS and 0 <= j < CELLS else -1


@compiled
def walks(moving: np.ndarray, x: float, y: float, spare: float) -> bool:
    """Whether a place is on something that moves; rows of `Seen`."""
    for m in range(len(moving)):
        reach = moving[m, 3] + spare
        qx, qy = x - moving[m, 1], y - moving[m, 2]
        near = abs(qx) < reach and qx * qx + qy * qy < reach * reach
        if near and moving[m, 0] >= 0.0:
            return True
    return False


@compiled
def absorb(
    params: Any,
    grid: np.ndarray,
    place: RobotState,
    scan: np.ndarray,
    moving: np.ndarray,
) -> np.ndarray:
    """The grid after another scan.

    Args:
        params: A record with the grid's `left`, `bottom` and `cell`, and the lidar's
            `noise`.
        grid: Rows of `Cell`.
        place: From where the scan was taken.
        scan: Rows of `Ray`.
        moving: Rows of `Seen`: what is left out.
    """
    new = grid.copy()
    moving = moving[moving[:, 0] >= 0.0]
    hit = np.zeros(len(grid), np.bool_)
    ahead, across = cos(place.theta), sin(place.theta)
    for k in range(RAYS):
        r = scan[k, 0]
        if r == 0.0:
            continue
        ex, ey = ray(ahead, across, k)
        x, y = place.x + r * ex, place.y + r * ey
        c = cell_of(params, x, y)
        if c < 0 or walks(moving, x, y, 0.15):
            continue
        if new[c, 0] >= RELIABLE:  # else the map would follow the place's errors
            if not hit[c]:
                new[c, 0] = min(new[c, 0] + HIT, MOST)
            hit[c] = True
            continue
        known = new[c, 0] > 0.0
        hits = new[c, 0] / HIT if known else 0.0
        gain = 1.0 / (1.0 + hits) if not hit[c] or hits < 1.5 else 0.02
        new[c, 1] += gain * (x - new[c, 1]) if known else x - new[c, 1]
        new[c, 2] += gain * (y - new[c, 2]) if known else y - new[c, 2]
        if not hit[c]:
            new[c, 0] = min(max(new[c, 0], 0.0) + HIT, MOST)
        hit[c] = True
    _clear(params, new, hit, place, scan)
    return new


@compiled
def _clear(
    params: Any, grid: np.ndarray, hit: np.ndarray, place: RobotState, scan: np.ndarray
) -> None:
    """Makes cells freer that were not hit and through which rays pass.

    Through one where something stood only the ray nearest to it says that it is gone;
    elsewhere every other ray will do.
    """
    cell, reach = params.cell, params.clear / params.cell
    px, py = (place.x - params.left) / cell, (place.y - params.bottom) / cell
    ahead, across = cos(place.theta), sin(place.theta)
    for i in range(max(int(px - reach), 0), min(int(px + reach) + 1, CELLS)):
        for j in range(max(int(py - reach), 0), min(int(py + reach) + 1, CELLS)):
            c = i * CELLS + j
            if grid[c, 0] <= 0.0 or hit[c]:
                continue
            qx, qy = grid[c, 1] - place.x, grid[c, 2] - place.y
            bearing = (atan2(qy, qx) - place.theta) / STEP
            k, d = round(bearing), hypot(qx, qy)
            near = d * abs(sin((bearing - k) * STEP)) <= THROUGH
            if near and d <= _free(params, scan[k % RAYS, 0]):
                grid[c, 0] = max(grid[c, 0] + MISS, LEAST)
    for k in range(0, RAYS, 2):
        ex, ey = ray(ahead, across, k)
        for step in range(int(_free(params, scan[k, 0]) / cell)):
            i, j = floor(px + (step + 0.5) * ex), floor(py + (step + 0.5) * ey)
            if 0 <= i < CELLS and 0 <= j < CELLS and grid[i * CELLS + j, 0] <= 0.0:
                grid[i * CELLS + j, 0] = LEAST


@compiled
def _free(params: Any, r: float) -> float:
    """How far [m] a ray of range r passes through nothing."""
    # What nothing comes back from is far away, or a dropout, which is rare.
    return params.clear if r == 0.0 else min(r - SHORT, params.clear)


@compiled
def stands(params: Any, grid: np.ndarray, x: float, y: float) -> float:
    """The log of odds of what a point belongs to, 0 if it is new there.

    From `RELIABLE` on, how much more does not matter.
    """
    most = 0.0
    c = cell_of(params, x, y)
    if c < 0:
        return most
    for beside in AROUND:
        k = c + beside
        if k < 0 or k >= len(grid) or grid[k, 0] < max(SETTLED, most):
            continue
        qx, qy = grid[k, 1] - x, grid[k, 2] - y
        if qx * qx + qy * qy < params.cell * params.cell:
            most = grid[k, 0]
            if most >= RELIABLE:
                break
    return most


@compiled
def standing(
    params: Any, grid: np.ndarray, place: RobotState, vision: float
) -> np.ndarray:
    """What stands within sight of the memory: points, the nearest first.

    Cells keep their numbers, so that whoever follows one finds it again. Far away one
    of four neighbours is enough to close a wall.

    Args:
        params: As for `absorb`; and `point`, the radius that a point is given.
        grid: Rows of `Cell`.
        place: Where the robot is.
        vision: How far it looks [m].

    Returns:
        Rows of `Seen`, (STANDING, 6).
    """
    reach = int(vision / params.cell) + 2
    found, count = np.empty(((2 * reach + 1) ** 2, 2)), 0
    i0 = floor((place.x - params.left) / params.cell)
    j0 = floor((place.y - params.bottom) / params.cell)
    for i in range(max(i0 - reach, 0), min(i0 + reach + 1, CELLS)):
        for j in range(max(j0 - reach, 0), min(j0 + reach + 1, CELLS)):
            k = i * CELLS + j
            if grid[k, 0] < OCCUPIED:
                continue
            d = hypot(grid[k, 1] - place.x, grid[k, 2] - place.y)
            if d > vision:
                continue
            if d > NEAR:
                first = True
                for n in range((i % 2) * 2 + j % 2):  # those before it in its four
                    o = (i - i % 2 + n // 2) * CELLS + j - j % 2 + n % 2
                    first = first and grid[o, 0] < OCCUPIED
                if not first:
                    continue
            found[count, 0], found[count, 1] = d, k
            count += 1
    rows = np.zeros((STANDING, 6))
    rows[:, 0] = -1.0
    order = np.argsort(found[:count, 0])
    for n in range(min(count, STANDING)):
        k = int(found[order[n], 1])
        rows[n, 0] = 1000.0 + k
        rows[n, 1], rows[n, 2] = grid[k, 1], grid[k, 2]
        rows[n, 3] = params.point
    return rows
