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

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, dot, norm, sub

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
def in_channel(s: Space, p: Numbers, rho: float) -> bool:
    """Whether a ball lies in the access channel."""
    across2 = p[0] * p[0] + p[1] * p[1]
    return p[2] + rho <= s.depth and across2 <= (s.channel - rho) ** 2


@compiled
def in_voxels(s: Space, p: Numbers) -> Vector:
    """A point in units of voxels: voxel (i, j, k) has its centre there."""
    return (
        (p[0] - s.origin[0]) / s.spacing,
        (p[1] - s.origin[1]) / s.spacing,
        (p[2] - s.origin[2]) / s.spacing,
    )


@compiled
def cell(s: Space, voxel: int) -> tuple[int, int, int]:
    """(i, j, k) of a voxel, from its flat index."""
    _, ny, nz = s.size
    return voxel // (ny * nz), voxel // nz % ny, voxel % nz


@compiled
def centre(s: Space, voxel: int) -> Vector:
    """Where a voxel's centre lies in W, by its flat index."""
    return along(s.origin, s.spacing, cell(s, voxel))


@compiled
def on_grid(s: Space, u: Vector, half: Vector) -> bool:
    """Whether a box about a point lies on the grid; all in voxels."""
    for r in range(3):
        if not (u[r] - half[r] >= -0.5 and u[r] + half[r] <= s.size[r] - 0.5):
            return False  # also where a number is NaN
    return True


@compiled
def span(u: float, r: float, size: int) -> tuple[int, int]:
    """First voxel along an axis within r of u, and one past the last."""
    return max(math.ceil(u - r), 0), min(math.floor(u + r) + 1, size)


@compiled
def row_span(s: Space, u: Vector, left: float, a: int, b: int) -> tuple[int, int]:
    """A ball's part of row (a, b): first flat index, and one past the last.

    Args:
        s: The space.
        u: The ball's centre, in voxels.
        left: Square of its radius in plane a, in voxels.
        a: The row's x.
        b: The row's y.
    """
    rest = left - (b - u[1]) ** 2
    if rest < 0.0:
        return 0, 0
    _, ny, nz = s.size
    low, high = span(u[2], math.sqrt(rest), nz)
    row = (a * ny + b) * nz
    return row + low, row + high


@compiled
def first_solid(s: Space, p: Numbers, rho: float) -> int:
    """The first voxel that a ball would meet: its flat index, FREE or OUTSIDE."""
    if in_channel(s, p, rho):
        return FREE
    u = in_voxels(s, p)
    r = rho / s.spacing
    if not on_grid(s, u, (r, r, r)):
        return OUTSIDE
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    return c
    return FREE


@compiled
def voxel_of(s: Space, p: Numbers) -> int:
    """Flat index of the voxel that holds a point; OUTSIDE if none does."""
    nx, ny, nz = s.size
    u = in_voxels(s, p)
    i, j, k = math.floor(u[0] + 0.5), math.floor(u[1] + 0.5), math.floor(u[2] + 0.5)
    if 0 <= i < nx and 0 <= j < ny and 0 <= k < nz:
        return (i * ny + j) * nz + k
    return OUTSIDE


@compiled
def body_solid(s: Space, p: Numbers, rho: float) -> int:
    """As `first_solid` for the body's radius, remembering where it fitted."""
    at = voxel_of(s, p)
    if at >= 0 and s.roomy[at]:
        return FREE
    found = first_solid(s, p, rho)
    if found != FREE or at < 0:
        return found
    if first_solid(s, centre(s, at), rho + NEIGHBOUR * s.spacing) == FREE:
        s.roomy[at] = 1
        s.roomed[s.used[1]] = at
        s.used[1] += 1
    return found


@compiled
def plate_solid(s: Space, p: Numbers, n: Numbers, length: float, rho: float) -> int:
    """The first voxel that a cylinder would meet: its flat index, FREE or OUTSIDE.

    The cylinder starts at p and is `length` m long along n.
    """
    end = along(p, length, n)
    rim = rho * math.sqrt(max(1.0 - n[2] * n[2], 0.0))
    out = math.sqrt(p[0] * p[0] + p[1] * p[1])
    far = math.sqrt(end[0] * end[0] + end[1] * end[1])
    if max(p[2], end[2]) + rim <= s.depth and max(out, far) + rho <= s.channel:
        return FREE
    u = in_voxels(s, along(p, length / 2, n))
    r, h = rho / s.spacing, length / 2 / s.spacing
    half = (
        h * abs(n[0]) + r * math.sqrt(max(1.0 - n[0] * n[0], 0.0)),
        h * abs(n[1]) + r * math.sqrt(max(1.0 - n[1] * n[1], 0.0)),
        h * abs(n[2]) + r * math.sqrt(max(1.0 - n[2] * n[2], 0.0)),
    )
    if not on_grid(s, u, half):
        return OUTSIDE
    _, ny, nz = s.size
    for a in range(math.ceil(u[0] - half[0]), math.floor(u[0] + half[0]) + 1):
        for b in range(math.ceil(u[1] - half[1]), math.floor(u[1] + half[1]) + 1):
            row = (a * ny + b) * nz
            for c in range(math.ceil(u[2] - half[2]), math.floor(u[2] + half[2]) + 1):
                if s.tau[row + c] == SOLID:
                    d = sub((a, b, c), u)
                    axial = dot(d, n)
                    if abs(axial) <= h and dot(d, d) - axial * axial <= r * r:
                        return row + c
    return FREE


@compiled
def first_forbidden(s: Space, p: Numbers, rho: float) -> int:
    """The first voxel of a ball where the tool may not be, FREE or OUTSIDE."""
    if in_channel(s, p, rho):
        return FREE
    u = in_voxels(s, p)
    r = rho / s.spacing
    at = voxel_of(s, p)
    if at >= 0 and s.inside[at] - norm(sub(u, cell(s, at))) > r:
        return FREE
    if not on_grid(s, u, (r, r, r)):
        return OUTSIDE
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.allowed[c] == 0:
                    return c
    return FREE


@compiled
def count_solid(s: Space, p: Numbers, rho: float) -> int:
    """How many voxels of a ball are still solid."""
    u = in_voxels(s, p)
    r = rho / s.spacing
    count = 0
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    count += 1
    return count


@compiled
def stamp(s: Space, p: Numbers, rho: float, time: int) -> None:
    """Frees what of a ball is still solid, at a time."""
    u = in_voxels(s, p)
    r = rho / s.spacing
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    s.tau[c] = time
                    s.freed[s.used[0]] = c
                    s.used[0] += 1


@compiled
def roll_back(s: Space, freed: int, roomed: int) -> None:
    """Undoes all that the journals hold beyond these many entries."""
    for n in range(freed, s.used[0]):
        s.tau[s.freed[n]] = SOLID
    for n in range(roomed, s.used[1]):
        s.roomy[s.roomed[n]] = 0
    s.used[0], s.used[1] = freed, roomed


@compiled
def nearest_in_ball(
    s: Space, forbidden: bool, p: Numbers, rho: float
) -> tuple[int, float]:
    """The voxel in a ball's way that is nearest to its centre.

    Args:
        s: The space.
        forbidden: Whether voxels the tool may not be in are meant, not solid ones.
        p: Its centre in m.
        rho: Its radius in m.

    Returns:
        Its flat index, or OUTSIDE, and its distance from the centre in m.
    """
    best, found = math.inf, OUTSIDE
    u = in_voxels(s, p)
    r = max(rho / s.spacing, 0.87)
    nx, ny, nz = s.size
    for a in range(*span(u[0], r, nx)):
        for b in range(*span(u[1], r, ny)):
            for c in range(*span(u[2], r, nz)):
                at = (a * ny + b) * nz + c
                wrong = s.allowed[at] == 0 if forbidden else s.tau[at] == SOLID
                if wrong:
                    d = norm(sub((a, b, c), u))
                    if d <= r and d < best:
                        best, found = d, at
    return found, best * s.spacing


def journals(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Empty journals for so many voxels, and their counts."""
    return np.empty(count, np.int32), np.empty(count, np.int32), np.zeros(2, np.int64)
