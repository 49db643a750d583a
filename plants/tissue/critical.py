"""What must not be touched, on the operated grid: covered, and measured.

A tumour may be resampled by its shape; a vessel one voxel thin would get lost. A voxel
of the grid that overlaps a critical voxel of the mask is critical, and distances are
to the mask's own voxels, which are boxes at any angle to the grid.
"""

from dataclasses import dataclass
from functools import cached_property
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.common.compiled import compiled

Array = NDArray[np.float64]

EXACT = 5e-3
"""Up to here distances are exact, in m; longer ones may be a little too long, where
what is nearest lies far beside the grid."""


@dataclass
class Boxes:
    """Voxels of one mask.

    Attributes:
        index: Of the voxels, int (n, 3).
        X_WV: From voxel indices to W, in m, (4, 4); its axes are perpendicular.
    """

    index: NDArray[np.int64]
    X_WV: Array

    @cached_property
    def centres(self) -> Array:
        """In W, (n, 3)."""
        return self.index.astype(float) @ self.X_WV[:3, :3].T + self.X_WV[:3, 3]

    @property
    def halves(self) -> Array:
        """From a box's centre to the middles of three of its faces, in rows, (3, 3)."""
        return self.X_WV[:3, :3].T / 2

    def meet_tube(self, radius: float, end: float) -> bool:
        """Whether a tube about z that comes from -z and ends at `end` meets any."""
        centres, halves = self.centres, self.halves
        before = centres[:, 2] - np.abs(halves[:, 2]).sum() < end
        middle, across = centres[before, :2], halves[:, :2]
        # Seen along z a box is a hexagon: a line between it and a disc is along one of
        # its edges, or square to the way to its middle.
        apart = np.zeros(len(middle), bool)
        for normal in (*(np.array([[-y, x]]) for x, y in across), middle):
            unit = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
            gap = np.abs((middle * unit).sum(axis=1))
            apart |= gap - np.abs(unit @ across.T).sum(axis=1) > radius
        return not apart.all()


def cover(
    boxes: Boxes, origin: Array, spacing: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Which voxels of a grid overlap boxes, and how far the others are.

    Args:
        boxes: The boxes.
        origin: Centre of the grid's first voxel in W, in m.
        spacing: Edge of its voxels in m.
        shape: Voxels along its axes.

    Returns:
        Whether a voxel and a box have more than a face in common, and the distance
        from the voxel's centre to the nearest box in m, both of that shape.
    """
    halves = boxes.halves
    half = np.linalg.norm(halves, axis=1)
    axes = halves / half[:, None]
    # Two boxes are apart if they are along one of these directions.
    parting = [*np.eye(3), *axes, *(np.cross(e, a) for e in np.eye(3) for a in axes)]
    normals = np.array([n for n in parting if np.linalg.norm(n) > 1e-6])
    reach = 0.5 * spacing * np.abs(normals).sum(axis=1)
    reach += np.abs(normals @ halves.T).sum(axis=1)
    # Boxes beside the grid count, so it is computed with a rim.
    rim = math.ceil(EXACT / spacing)
    wide = tuple(n + 2 * rim for n in shape)
    covered = np.zeros(wide, np.bool_)
    away = np.full(wide, np.inf, np.float32)
    nearest = np.full(wide, -1, np.int32)
    grid, box = (origin - rim * spacing, spacing), (axes, half)
    _seed(grid, boxes.centres, box, normals, reach, covered, away, nearest)
    for _ in range(2):
        _spread(grid, boxes.centres, box, away, nearest)
    within = (slice(rim, -rim),) * 3
    return covered[within].copy(), away[within].copy()


@compiled
def _seed(
    grid: Any,
    centres: Any,
    box: Any,
    normals: Any,
    reach: Any,
    covered: Any,
    away: Any,
    nearest: Any,
) -> None:
    """Enters each box where it is, or at the edge of the grid where that is nearest."""
    origin, spacing = grid
    axes, half = box
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(len(centres)):
        for a in range(3):
            extent = 0.5 * spacing
            for b in range(3):
                extent += abs(axes[b, a]) * half[b]
            first = math.floor((centres[n, a] - extent - origin[a]) / spacing)
            last = math.ceil((centres[n, a] + extent - origin[a]) / spacing)
            low[a] = min(max(first, 0), covered.shape[a] - 1)
            high[a] = min(max(last, 0), covered.shape[a] - 1)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    x = origin[0] + i * spacing - centres[n, 0]
                    y = origin[1] + j * spacing - centres[n, 1]
                    z = origin[2] + k * spacing - centres[n, 2]
                    d = _to_box(x, y, z, axes, half)
                    if d < away[i, j, k]:
                        away[i, j, k], nearest[i, j, k] = d, n
                    meets = True
                    for m in range(len(normals)):
                        gap = normals[m, 0] * x + normals[m, 1] * y + normals[m, 2] * z
                        # A common face is not an overlap.
                        meets = meets and abs(gap) < reach[m] * (1.0 - 1e-6)
                    if meets:
                        covered[i, j, k] = True


@compiled
def _spread(grid: Any, centres: Any, box: Any, away: Any, nearest: Any) -> None:
    """Hands the nearest box on to neighbours, there and back."""
    origin, spacing = grid
    axes, half = box
    nx, ny, nz = away.shape
    for way in (1, -1):
        for p in range(nx):
            i = p if way > 0 else nx - 1 - p
            for q in range(ny):
                j = q if way > 0 else ny - 1 - q
                for r in range(nz):
                    k = r if way > 0 else nz - 1 - r
                    for m in range(13):  # the neighbours that come before
                        u, v, w = m // 9 - 1, m // 3 % 3 - 1, m % 3 - 1
                        a, b, c = i + way * u, j + way * v, k + way * w
                        if not (0 <= a < nx and 0 <= b < ny and 0 <= c < nz):
                            continue
                        n = nearest[a, b, c]
                        if n < 0 or n == nearest[i, j, k]:
                            continue
                        d = _to_box(
                            origin[0] + i * spacing - centres[n, 0],
                            origin[1] + j * spacing - centres[n, 1],
                            origin[2] + k * spacing - centres[n, 2],
                            axes,
                            half,
                        )
                        if d < away[i, j, k] * (1.0 - 1e-6):
                            away[i, j, k], nearest[i, j, k] = d, n


@compiled
def _to_box(x: float, y: float, z: float, axes: Any, half: Any) -> float:
    """Distance from a point to a box about the origin."""
    total = 0.0
    for a in range(3):
        along = abs(axes[a, 0] * x + axes[a, 1] * y + axes[a, 2] * z) - half[a]
        if along > 0.0:
            total += along * along
    return math.sqrt(total)
