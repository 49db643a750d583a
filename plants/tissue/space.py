"""Free space as compiled functions see it: balls against voxels.

One integer a voxel, its arrival time, is the whole state: 0 where space is free
from the start (the access channel), k where the k-th pose of the plan freed it,
`SOLID` elsewhere. Space only ever grows, so what fitted once fits for ever:

- a ball known to fit (`roomy`) need not be looked at again;
- a path once driven stays free, so the way back is always open.

`solid` holds the same as bits, 64 voxels of a row in a word: most rows that a ball
or a plate meets hold nothing solid, and one look tells.

A speculation (a candidate procedure) writes to the same arrays and is rolled back from
its journal. Voxel (i, j, k) has its centre at origin + spacing (i, j, k).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, dot, norm, sub, xyz

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
        solid: Bit c % 64 of word (a ny + b) words + c // 64 is set where voxel
            (a, b, c) is solid, int64.
        barred: The same where the tool may not be, int64.
        size: Voxels along x, y, z.
        words: Words of a row of `solid`.
        origin: Centre of voxel (0, 0, 0) in the channel frame W, in m.
        spacing: Edge of a voxel in m.
        channel: Radius of the access channels in m.
        channels: Of each the point and the axis in W, and where it ends along
            that in m, (n, 7).
        freed: Journal of voxels freed, int32.
        roomed: Journal of voxels found roomy, int32.
        used: Entries of either journal, int64 (2).
    """

    tau: Any
    allowed: Any
    inside: Any
    roomy: Any
    solid: Any
    barred: Any
    size: tuple[int, int, int]
    words: int
    origin: tuple[float, float, float]
    spacing: float
    channel: float
    channels: Any
    freed: Any
    roomed: Any
    used: Any


@compiled
def off_axis(s: Space, k: int, p: Numbers) -> tuple[float, float]:
    """A point's place along the axis of channel k, and its distance from it."""
    o, n = xyz(s.channels[k], 0), xyz(s.channels[k], 3)
    d = sub(p, o)
    along_ = dot(d, n)
    return along_, norm(sub(d, along((0.0, 0.0, 0.0), along_, n)))


@compiled
def in_channel(s: Space, p: Numbers, rho: float) -> bool:
    """Whether a ball lies in an access channel."""
    for k in range(len(s.channels)):
        far, across = off_axis(s, k, p)
        if far + rho <= s.channels[k, 6] and across <= s.channel - rho:
            return True
    return False


@compiled
def bits(first: int, low: int, high: int) -> int:
    """A word's mask of the voxels low to high - 1 of a row; its own begin at first."""
    mask = -1
    if low > first:
        mask <<= low - first
    if high < first + 64:
        mask &= ~(-1 << (high - first))
    return mask


@compiled
def ones(word: int) -> int:
    """How many bits of a word are set."""
    word -= (word >> 1) & 0x5555555555555555
    word = (word & 0x3333333333333333) + ((word >> 2) & 0x3333333333333333)
    word = (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0F
    return (word * 0x0101010101010101) >> 56


@compiled
def any_set(s: Space, plane: Any, a: int, b: int, low: int, high: int) -> bool:
    """Whether any voxel (a, b, low) to (a, b, high - 1) is set in a plane of bits."""
    row = (a * s.size[1] + b) * s.words
    for w in range(low >> 6, (high + 63) >> 6):
        if plane[row + w] & bits(w << 6, low, high):
            return True
    return False


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
def between_channels(s: Space, p: Numbers, rho: float) -> bool:
    """Whether what of a ball lies beyond the grid lies in channels together."""
    if len(s.channels) < 2:
        return False
    for a in range(-1, 2):
        for b in range(-1, 2):
            for c in range(-1, 2):
                far = math.sqrt(a * a + b * b + c * c)
                if far == 0.0:
                    continue
                q = along(p, rho / far, (float(a), float(b), float(c)))
                if voxel_of(s, q) == OUTSIDE and not in_channel(s, q, 0.0):
                    return False
    return True


@compiled
def first_solid(s: Space, p: Numbers, rho: float) -> int:
    """The first voxel that a ball would meet: its flat index, FREE or OUTSIDE."""
    if in_channel(s, p, rho):
        return FREE
    u = in_voxels(s, p)
    r = rho / s.spacing
    if not on_grid(s, u, (r, r, r)) and not between_channels(s, p, rho):
        return OUTSIDE
    below, above = span(u[2], r, s.size[2])
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            if not any_set(s, s.solid, a, b, below, above):
                continue
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
    for k in range(len(s.channels)):
        tilt = dot(n, xyz(s.channels[k], 3))
        rim = rho * math.sqrt(max(1.0 - tilt * tilt, 0.0))
        near, out = off_axis(s, k, p)
        far, across = off_axis(s, k, end)
        within = max(near, far) + rim <= s.channels[k, 6]
        if within and max(out, across) + rho <= s.channel:
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
    below, above = math.ceil(u[2] - half[2]), math.floor(u[2] + half[2]) + 1
    for a in range(math.ceil(u[0] - half[0]), math.floor(u[0] + half[0]) + 1):
        for b in range(math.ceil(u[1] - half[1]), math.floor(u[1] + half[1]) + 1):
            if not any_set(s, s.solid, a, b, below, above):
                continue
            row = (a * ny + b) * nz
            for c in range(below, above):
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
    below, above = span(u[2], r, s.size[2])
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            if not any_set(s, s.barred, a, b, below, above):
                continue
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.allowed[c] == 0:
                    return c
    return FREE


@compiled
def count_solid(s: Space, p: Numbers, rho: float, plane: Any) -> int:
    """How many voxels of a ball are solid and set in a plane laid out as `solid`."""
    u = in_voxels(s, p)
    r = rho / s.spacing
    count = 0
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            rest = left - (b - u[1]) ** 2
            if rest < 0.0:
                continue
            low, high = span(u[2], math.sqrt(rest), s.size[2])
            row = (a * s.size[1] + b) * s.words
            for w in range(low >> 6, (high + 63) >> 6):
                word = s.solid[row + w] & plane[row + w]
                if word:
                    count += ones(word & bits(w << 6, low, high))
    return count


@compiled
def bit_of(s: Space, voxel: int) -> tuple[int, int]:
    """The word of a voxel in `solid`, and its bit there."""
    row, c = voxel // s.size[2], voxel % s.size[2]
    return row * s.words + (c >> 6), 1 << (c & 63)


@compiled
def free(s: Space, voxel: int, time: int) -> None:
    """Frees a voxel that is solid, at a time."""
    word, bit = bit_of(s, voxel)
    s.tau[voxel] = time
    s.solid[word] &= ~bit
    s.freed[s.used[0]] = voxel
    s.used[0] += 1


@compiled
def stamp(s: Space, p: Numbers, rho: float, time: int) -> None:
    """Frees what of a ball is still solid, at a time."""
    u = in_voxels(s, p)
    r = rho / s.spacing
    below, above = span(u[2], r, s.size[2])
    for a in range(*span(u[0], r, s.size[0])):
        left = r * r - (a - u[0]) ** 2
        for b in range(*span(u[1], r, s.size[1])):
            if not any_set(s, s.solid, a, b, below, above):
                continue
            first, last = row_span(s, u, left, a, b)
            for c in range(first, last):
                if s.tau[c] == SOLID:
                    free(s, c, time)


@compiled
def roll_back(s: Space, freed: int, roomed: int) -> None:
    """Undoes all that the journals hold beyond these many entries."""
    for n in range(freed, s.used[0]):
        word, bit = bit_of(s, s.freed[n])
        s.tau[s.freed[n]] = SOLID
        s.solid[word] |= bit
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


def as_bits(mask: np.ndarray) -> np.ndarray:
    """A mask (nx, ny, nz) as `Space.solid` has it, int64."""
    words = -(-mask.shape[2] // 64)
    wide = np.zeros((*mask.shape[:2], 64 * words), np.uint8)
    wide[..., : mask.shape[2]] = mask
    return np.packbits(wide, axis=2, bitorder="little").reshape(-1).view("<i8")


def journals(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Empty journals for so many voxels, and their counts."""
    return np.empty(count, np.int32), np.empty(count, np.int32), np.zeros(2, np.int64)
