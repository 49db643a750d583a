"""Free space as compiled functions see it: balls against voxels.

One integer a voxel, its arrival time, is the whole state: 0 where space is free
from the start (the access channel), k where the k-th pose of the plan freed it,
`SOLID` elsewhere. Space only ever grows, so what fitted once fits for ever:

- a ball known to fit (`roomy`) need not be looked at again;
- a path once driven stays free, so the way back is always open.

A speculation (a candidate procedure) writes to the same arrays and is rolled back
from its journal. Voxel (i, j, k) has its centre at origin + spacing (i, j, k).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled

SOLID = 2**31 - 1
"""Arrival time of tissue that nothing has removed."""

FREE = -1
OUTSIDE = -2
"""Answers of `first_solid` beside a voxel's index: free, or beyond the grid."""

NEIGHBOUR = 0.8661
"""No point is farther, in voxels, from the nearest voxel's centre: sqrt(3)/2."""


class Space(NamedTuple):
    """The arrays; flat, C order over `size`.

    Attributes:
        tau: Arrival time of each voxel, int32.
        allowed: 1 where the tool may be: tumour and channel, off what is critical.
        inside: Distance from each allowed voxel to the nearest one that is not,
            in voxels, float32.
        roomy: 1 where a ball of the body's radius about any point of the voxel is
            known to be free, uint8.
        size: Voxels along x, y, z.
        origin: Centre of voxel (0, 0, 0) in the channel frame W, in m.
        spacing: Edge of a voxel in m.
        channel: Radius of the access channel in m.
        depth: Where the access robot's channel ends, in m along z.
        freed: Journal of voxels freed, int32.
        roomed: Journal of voxels found roomy, int32.
        used: Entries of either journal, int64 (2).
    """

    tau: Any
    allowed: Any
    inside: Any
    roomy: Any
    size: tuple[int, int, int]
    origin: tuple[float, float, float]
    spacing: float
    channel: float
    depth: float
    freed: Any
    roomed: Any
    used: Any


@compiled
def in_channel(s: Any, x: float, y: float, z: float, rho: float) -> bool:
    """Whether a ball lies in the access channel."""
    return z + rho <= s.depth and x * x + y * y <= (s.channel - rho) ** 2


@compiled
def in_voxels(s: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A point in units of voxels: voxel (i, j, k) has its centre there."""
    return (
        (x - s.origin[0]) / s.spacing,
        (y - s.origin[1]) / s.spacing,
        (z - s.origin[2]) / s.spacing,
    )


@compiled
def on_grid(
    s: Any, u: float, v: float, w: float, du: float, dv: float, dw: float
) -> bool:
    """Whether a box about a point lies on the grid; all in voxels."""
    nx, ny, nz = s.size
    return (
        u - du >= -0.5
        and v - dv >= -0.5
        and w - dw >= -0.5
        and u + du <= nx - 0.5
        and v + dv <= ny - 0.5
        and w + dw <= nz - 0.5
    )


@compiled
def span(u: float, r: float, size: int) -> tuple[int, int]:
    """First voxel along an axis within r of u, and one past the last."""
    return max(math.ceil(u - r), 0), min(math.floor(u + r) + 1, size)


@compiled
def row_span(
    s: Any, v: float, w: float, left: float, a: int, b: int
) -> tuple[int, int]:
    """A ball's part of row (a, b): first flat index, and one past the last.

    Args:
        s: The space.
        v: The ball's centre along y, in voxels.
        w: The same along z.
        left: Square of its radius in plane a, in voxels.
        a: The row's x.
        b: The row's y.
    """
    rest = left - (b - v) ** 2
    if rest < 0.0:
        return 0, 0
    _, ny, nz = s.size
    low, high = span(w, math.sqrt(rest), nz)
    row = (a * ny + b) * nz
    return row + low, row + high


@compiled
def first_solid(s: Any, x: float, y: float, z: float, rho: float) -> int:
    """The first voxel that a ball would meet: its flat index, FREE or OUTSIDE."""
    if in_channel(s, x, y, z, rho):
        return FREE
    u, v, w = in_voxels(s, x, y, z)
    r = rho / s.spacing
    if not on_grid(s, u, v, w, r, r, r):
        return OUTSIDE
    for a in range(*span(u, r, s.size[0])):
        left = r * r - (a - u) ** 2
        for b in range(*span(v, r, s.size[1])):
            first, last = row_span(s, v, w, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    return c
    return FREE


@compiled
def voxel_of(s: Any, x: float, y: float, z: float) -> int:
    """Flat index of the voxel that holds a point; OUTSIDE if none does."""
    nx, ny, nz = s.size
    i = math.floor((x - s.origin[0]) / s.spacing + 0.5)
    j = math.floor((y - s.origin[1]) / s.spacing + 0.5)
    k = math.floor((z - s.origin[2]) / s.spacing + 0.5)
    if 0 <= i < nx and 0 <= j < ny and 0 <= k < nz:
        return (i * ny + j) * nz + k
    return OUTSIDE


@compiled
def body_solid(s: Any, x: float, y: float, z: float, rho: float) -> int:
    """As `first_solid` for the body's radius, remembering where it fitted."""
    at = voxel_of(s, x, y, z)
    if at >= 0 and s.roomy[at]:
        return FREE
    found = first_solid(s, x, y, z, rho)
    if found == FREE and at >= 0:
        g = s.spacing
        _, ny, nz = s.size
        i, j, k = at // (ny * nz), at // nz % ny, at % nz
        px, py, pz = s.origin[0] + g * i, s.origin[1] + g * j, s.origin[2] + g * k
        if first_solid(s, px, py, pz, rho + NEIGHBOUR * g) == FREE:
            s.roomy[at] = 1
            s.roomed[s.used[1]] = at
            s.used[1] += 1
    return found


@compiled
def plate_solid(
    s: Any,
    x: float,
    y: float,
    z: float,
    n0: float,
    n1: float,
    n2: float,
    length: float,
    rho: float,
) -> int:
    """The first voxel that a cylinder would meet: its flat index, FREE or OUTSIDE.

    The cylinder starts at (x, y, z) and is `length` m long along (n0, n1, n2).
    """
    end = z + length * n2
    rim = rho * math.sqrt(max(1.0 - n2 * n2, 0.0))
    out = math.sqrt(x * x + y * y)
    far = math.sqrt((x + length * n0) ** 2 + (y + length * n1) ** 2)
    if max(z, end) + rim <= s.depth and max(out, far) + rho <= s.channel:
        return FREE
    half = length / 2
    u, v, w = in_voxels(s, x + half * n0, y + half * n1, z + half * n2)
    r, h = rho / s.spacing, half / s.spacing
    du = h * abs(n0) + r * math.sqrt(max(1.0 - n0 * n0, 0.0))
    dv = h * abs(n1) + r * math.sqrt(max(1.0 - n1 * n1, 0.0))
    dw = h * abs(n2) + r * math.sqrt(max(1.0 - n2 * n2, 0.0))
    if not on_grid(s, u, v, w, du, dv, dw):
        return OUTSIDE
    _, ny, nz = s.size
    for a in range(math.ceil(u - du), math.floor(u + du) + 1):
        for b in range(math.ceil(v - dv), math.floor(v + dv) + 1):
            row = (a * ny + b) * nz
            for c in range(math.ceil(w - dw), math.floor(w + dw) + 1):
                if s.tau[row + c] == SOLID:
                    e0, e1, e2 = a - u, b - v, c - w
                    along = e0 * n0 + e1 * n1 + e2 * n2
                    across = e0 * e0 + e1 * e1 + e2 * e2 - along * along
                    if abs(along) <= h and across <= r * r:
                        return row + c
    return FREE


@compiled
def first_forbidden(s: Any, x: float, y: float, z: float, rho: float) -> int:
    """The first voxel of a ball where the tool may not be, FREE or OUTSIDE."""
    if in_channel(s, x, y, z, rho):
        return FREE
    u, v, w = in_voxels(s, x, y, z)
    r = rho / s.spacing
    at = voxel_of(s, x, y, z)
    if at >= 0:
        _, ny, nz = s.size
        i, j, k = at // (ny * nz), at // nz % ny, at % nz
        off = math.sqrt((u - i) ** 2 + (v - j) ** 2 + (w - k) ** 2)
        if s.inside[at] - off > r:
            return FREE
    if not on_grid(s, u, v, w, r, r, r):
        return OUTSIDE
    for a in range(*span(u, r, s.size[0])):
        left = r * r - (a - u) ** 2
        for b in range(*span(v, r, s.size[1])):
            first, last = row_span(s, v, w, left, a, b)
            for c in range(first, last):
                if s.allowed[c] == 0:
                    return c
    return FREE


@compiled
def count_solid(s: Any, x: float, y: float, z: float, rho: float) -> int:
    """How many voxels of a ball are still solid."""
    u, v, w = in_voxels(s, x, y, z)
    r = rho / s.spacing
    count = 0
    for a in range(*span(u, r, s.size[0])):
        left = r * r - (a - u) ** 2
        for b in range(*span(v, r, s.size[1])):
            first, last = row_span(s, v, w, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    count += 1
    return count


@compiled
def stamp(s: Any, x: float, y: float, z: float, rho: float, time: int) -> None:
    """Frees what of a ball is still solid, at a time."""
    u, v, w = in_voxels(s, x, y, z)
    r = rho / s.spacing
    for a in range(*span(u, r, s.size[0])):
        left = r * r - (a - u) ** 2
        for b in range(*span(v, r, s.size[1])):
            first, last = row_span(s, v, w, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    s.tau[c] = time
                    s.freed[s.used[0]] = c
                    s.used[0] += 1


@compiled
def roll_back(s: Any, freed: int, roomed: int) -> None:
    """Undoes all that the journals hold beyond these many entries."""
    for n in range(freed, s.used[0]):
        s.tau[s.freed[n]] = SOLID
    for n in range(roomed, s.used[1]):
        s.roomy[s.roomed[n]] = 0
    s.used[0], s.used[1] = freed, roomed


@compiled
def nearest_in_ball(
    s: Any, which: int, x: float, y: float, z: float, rho: float
) -> Any:
    """The voxel in a ball's way that is nearest to its centre.

    Args:
        s: The space.
        which: 0 for solid voxels, 1 for voxels the tool may not be in.
        x: Centre in m.
        y: Centre.
        z: Centre.
        rho: Radius in m.

    Returns:
        Its flat index, or OUTSIDE, and its distance from the centre in m.
    """
    best, found = math.inf, OUTSIDE
    u, v, w = in_voxels(s, x, y, z)
    r = max(rho / s.spacing, 0.87)
    nx, ny, nz = s.size
    for a in range(*span(u, r, nx)):
        for b in range(*span(v, r, ny)):
            for c in range(*span(w, r, nz)):
                at = (a * ny + b) * nz + c
                wrong = s.tau[at] == SOLID if which == 0 else s.allowed[at] == 0
                if wrong:
                    d = math.sqrt((a - u) ** 2 + (b - v) ** 2 + (c - w) ** 2)
                    if d <= r and d < best:
                        best, found = d, at
    return found, best * s.spacing


def journals(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Empty journals for so many voxels, and their counts."""
    return np.empty(count, np.int32), np.empty(count, np.int32), np.zeros(2, np.int64)
