"""The surface of a mask as a mesh: naive surface nets."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage


def surface(
    inside: NDArray[np.bool_],
    origin: NDArray[np.float64],
    spacing: float,
    smooth: float = 0.9,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Meshes the border of a mask.

    One vertex in each cell of eight voxels that the border runs through, at the mean
    of its crossings of the cell's edges; one square for each edge that it crosses.

    Args:
        inside: Mask (nx, ny, nz).
        origin: Centre of voxel (0, 0, 0) in m.
        spacing: Edge of a voxel in m.
        smooth: Width of the Gaussian that smooths the mask first, in voxels.

    Returns:
        Vertices in m (n, 3), and triangles (m, 3), counter-clockwise from outside.
    """
    padded = np.pad(inside.astype(np.float32), 2)
    field = ndimage.gaussian_filter(padded, smooth) - 0.5
    sign = field > 0.0
    cells = tuple(size - 1 for size in field.shape)
    total = np.zeros((*cells, 3), np.float32)
    count = np.zeros(cells, np.float32)
    corners = [(a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    for corner in corners:
        for axis in range(3):
            if corner[axis] == 1:
                continue
            other = tuple(v + (n == axis) for n, v in enumerate(corner))
            one, two = (
                field[tuple(slice(v, v + m) for v, m in zip(c, cells, strict=True))]
                for c in (corner, other)
            )
            crossed = (one > 0.0) != (two > 0.0)
            gap = np.where(crossed, one - two, 1.0)
            share = np.where(crossed, one / gap, 0.0)
            for n in range(3):
                total[..., n] += crossed * (corner[n] + (share if n == axis else 0.0))
            count += crossed
    at = np.argwhere(count > 0)
    number = np.full(cells, -1)
    number[tuple(at.T)] = np.arange(len(at))
    vertices = at + total[tuple(at.T)] / count[tuple(at.T)][:, None]
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        low = [slice(0, -1)] * 3
        high = [slice(0, -1)] * 3
        high[axis] = slice(1, None)
        edges = sign[tuple(low)] != sign[tuple(high)]
        where = np.argwhere(edges)
        where = where[(where[:, u] > 0) & (where[:, v] > 0)]
        outwards = sign[tuple(where.T)]
        quad = []
        for du, dv in ((1, 1), (0, 1), (0, 0), (1, 0)):
            shifted = where.copy()
            shifted[:, u] -= du
            shifted[:, v] -= dv
            quad.append(number[tuple(shifted.T)])
        a, b, c, d = quad
        b, d = np.where(outwards, b, d), np.where(outwards, d, b)
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    # Padding shifted indices by two.
    return origin + spacing * (vertices - 2.0), np.concatenate(faces)
