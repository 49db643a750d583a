"""A grid of signed distances to a closed surface, built once and kept.

Near the surface each voxel gets its exact distance to the nearest triangle; farther
away, to the nearest of those triangles that the voxels about it know. The sign is the
winding number's, counted along columns.
"""

import hashlib
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.organs.surface import Surface, SurfaceError, in_mm
from systems.common.archive import whole
from systems.common.compiled import compiled
from systems.common.geometry import along, cross, dot, norm, sub
from systems.common.signal import Vector

SPACING = 0.002
"""Of the voxels, m: with it interpolation errs by less than `ERROR`."""
ERROR = 0.0003
"""By which the distance may be too long near the surface, m; measured in the test."""
PAD = 0.032
"""Of the grid beyond the surface, m; from there on distances are a lower bound."""
MOST_VOXELS = 40_000_000
_BAND = 2.0  # voxels about the surface that are exact
_FORMAT = b"distance-grid-3"


class DistanceGrid(NamedTuple):
    """Signed distances at the centres of voxels, negative inside."""

    origin: NDArray[np.float64]
    """Centre of the first, m (3)."""
    spacing: float
    """m."""
    values: NDArray[np.float32]
    """m (nx, ny, nz)."""


@compiled
def triangle_distance(p: Vector, a: Vector, b: Vector, c: Vector) -> float:
    """Distance of a point from a triangle, m (Ericson, 5.1.5)."""
    ab, ac, ap = sub(b, a), sub(c, a), sub(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return norm(ap)
    bp = sub(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return norm(bp)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return norm(sub(p, along(a, d1 / (d1 - d3), ab)))
    cp = sub(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return norm(cp)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return norm(sub(p, along(a, d2 / (d2 - d6), ac)))
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return norm(sub(p, along(b, t, sub(c, b))))
    n = cross(ab, ac)
    return abs(dot(ap, n)) / max(norm(n), 1e-30)


@compiled
def _corner(points: np.ndarray, triangles: np.ndarray, t: int, k: int) -> Vector:
    i = triangles[t, k]
    return points[i, 0], points[i, 1], points[i, 2]


@compiled
def _distance(
    points: np.ndarray, triangles: np.ndarray, t: int, x: int, y: int, z: int
) -> float:
    a, b = _corner(points, triangles, t, 0), _corner(points, triangles, t, 1)
    p = (float(x), float(y), float(z))
    return triangle_distance(p, a, b, _corner(points, triangles, t, 2))


@compiled
def _near(
    points: np.ndarray, triangles: np.ndarray, band: float, far: np.ndarray
) -> np.ndarray:
    """Nearest triangle of each voxel within the band, -1 elsewhere; fills `far`."""
    nearest = np.full(far.shape, -1, np.int32)
    for t in range(len(triangles)):
        low, high = np.empty(3, np.int64), np.empty(3, np.int64)
        for n in range(3):
            corners = [points[triangles[t, k], n] for k in range(3)]
            low[n] = max(0, int(np.ceil(min(corners) - band)))
            high[n] = min(far.shape[n] - 1, int(np.floor(max(corners) + band)))
        for x in range(low[0], high[0] + 1):
            for y in range(low[1], high[1] + 1):
                for z in range(low[2], high[2] + 1):
                    d = _distance(points, triangles, t, x, y, z)
                    if d <= band and d < far[x, y, z]:
                        far[x, y, z] = d
                        nearest[x, y, z] = t
    return nearest


@compiled
def _spread(
    points: np.ndarray,
    triangles: np.ndarray,
    nearest: np.ndarray,
    seeds: np.ndarray,
    far: np.ndarray,
) -> None:
    """Distances beyond the band: to the triangles that the nearest seeds know."""
    nx, ny, nz = far.shape
    for x in range(nx):
        for y in range(ny):
            for z in range(nz):
                if nearest[x, y, z] >= 0:
                    continue
                last = -1
                for k in range(7):
                    i, j, m = x, y, z
                    if k > 0:
                        step = 2 * (k % 2) - 1
                        i += step * ((k - 1) // 2 == 0)
                        j += step * ((k - 1) // 2 == 1)
                        m += step * ((k - 1) // 2 == 2)
                    if not (0 <= i < nx and 0 <= j < ny and 0 <= m < nz):
                        continue
                    at = seeds[i, j, m]
                    t = nearest.ravel()[at]
                    if t == last:
                        continue
                    last = t
                    d = _distance(points, triangles, t, x, y, z)
                    if d < far[x, y, z]:
                        far[x, y, z] = d


@compiled
def _crossings(points: np.ndarray, triangles: np.ndarray, wound: np.ndarray) -> None:
    """Counts at each voxel how the surface is crossed since the one below it."""
    nx, ny, nz = wound.shape
    # Columns a little beside the lattice meet no edge of a surface that lies on it.
    ox, oy = 1.234567e-4, 2.718282e-4
    for t in range(len(triangles)):
        a, b = _corner(points, triangles, t, 0), _corner(points, triangles, t, 1)
        c = _corner(points, triangles, t, 2)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first = max(0, int(np.ceil(min(a[0], b[0], c[0]) - ox)))
        last = min(nx - 1, int(np.floor(max(a[0], b[0], c[0]) - ox)))
        low = max(0, int(np.ceil(min(a[1], b[1], c[1]) - oy)))
        high = min(ny - 1, int(np.floor(max(a[1], b[1], c[1]) - oy)))
        for x in range(first, last + 1):
            for y in range(low, high + 1):
                px, py = x + ox, y + oy
                u = (b[0] - px) * (c[1] - py) - (b[1] - py) * (c[0] - px)
                v = (c[0] - px) * (a[1] - py) - (c[1] - py) * (a[0] - px)
                w = area - u - v
                if u / area < 0.0 or v / area < 0.0 or w / area < 0.0:
                    continue
                z = (u * a[2] + v * b[2] + w * c[2]) / area
                k = max(0, int(np.ceil(z)))
                if k < nz:
                    # Going up through a face that looks down is going in.
                    wound[x, y, k] += 1 if area < 0.0 else -1


def winding(
    surface: Surface, origin: np.ndarray, spacing: float, shape: tuple[int, ...]
) -> np.ndarray:
    """How often the surface encloses each voxel's centre (nx, ny, nz)."""
    wound = np.zeros(shape, np.int16)
    _crossings((surface.points - origin) / spacing, surface.triangles, wound)
    return np.cumsum(wound, axis=2, dtype=np.int16)


def build(surface: Surface, name: str, spacing: float = SPACING) -> DistanceGrid:
    """The grid of a closed surface.

    Raises:
        SurfaceError: If it would be too large, or the surface crosses itself; says
            where.
    """
    low = surface.points.min(axis=0) - PAD
    high = surface.points.max(axis=0) + PAD
    shape = tuple(int(n) for n in np.ceil((high - low) / spacing) + 1)
    if np.prod(shape) > MOST_VOXELS:
        raise SurfaceError(
            f"{name}: {np.prod(shape):.3g} voxels of {1e3 * spacing:.2g} mm: expected "
            f"at most {MOST_VOXELS:.3g}"
        )
    wound = winding(surface, low, spacing, shape)
    if wound.min() < 0:  # turned inside out
        surface = Surface(surface.points, surface.triangles[:, ::-1].copy())
        wound = -wound
    wrong = np.argwhere((wound < 0) | (wound > 1))
    if len(wrong):
        middle = low + spacing * wrong.mean(axis=0)
        size = spacing * np.ptp(wrong, axis=0).max()
        raise SurfaceError(
            f"{name}: it crosses itself in {len(wrong)} voxels about {in_mm(middle)}, "
            f"within {1e3 * size:.0f} mm: expected a surface that encloses once"
        )
    far = np.full(shape, np.inf, np.float32)
    points = (surface.points - low) / spacing
    nearest = _near(points, surface.triangles, _BAND, far)
    unknown = nearest < 0
    index = ndimage.distance_transform_edt(
        unknown, return_distances=False, return_indices=True
    )
    seeds = np.ravel_multi_index(tuple(index), shape)
    _spread(points, surface.triangles, nearest, seeds, far)
    values = np.where(wound > 0, -far, far) * spacing
    return DistanceGrid(low, spacing, np.ascontiguousarray(values, np.float32))


def cache_folder() -> Path:
    """Where grids are kept: the user's cache."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "trocar" / "grids"


def kept(surface: Surface, name: str, spacing: float = SPACING) -> DistanceGrid:
    """The grid of a surface, from the cache if it was built before.

    Raises:
        SurfaceError: As `build`.
    """
    mark = hashlib.sha256(_FORMAT + np.array([spacing, PAD, _BAND]).tobytes())
    mark.update(np.ascontiguousarray(surface.points).tobytes())
    mark.update(np.ascontiguousarray(surface.triangles, np.int64).tobytes())
    path = cache_folder() / f"{mark.hexdigest()[:32]}.npz"
    try:
        with np.load(path) as found:
            return DistanceGrid(found["origin"], spacing, found["values"])
    except (OSError, ValueError, KeyError, EOFError):
        pass  # not there, or damaged: it is built anew
    grid = build(surface, name, spacing)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as draft, draft.open("wb") as stream:
            np.savez(stream, origin=grid.origin, values=grid.values)
    except OSError:
        pass  # no place to keep it
    return grid
