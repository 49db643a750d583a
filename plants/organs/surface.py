"""A closed surface of triangles, and what is wrong with one that is none.

Every edge of a closed surface is run through once in each direction. Where it crosses
itself its winding number, that counts how often it encloses a point, is 2 there; the
distance grid finds that (`distance_grid.py`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class SurfaceError(ValueError):
    """A surface that encloses nothing, or not one thing."""


class Surface(NamedTuple):
    """Triangles, counter-clockwise seen from outside."""

    points: NDArray[np.float64]
    """Vertices (n, 3), m."""
    triangles: NDArray[np.int64]
    """Indices of vertices (m, 3)."""


def open_edges(surface: Surface) -> NDArray[np.int64]:
    """Edges (k, 2) that have no partner of the other direction."""
    edges = surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = len(surface.points)
    there = edges[:, 0] * size + edges[:, 1]
    back = edges[:, 1] * size + edges[:, 0]
    keys, count = np.unique(there, return_counts=True)
    return edges[~np.isin(back, keys) | np.isin(there, keys[count > 1])]


def in_mm(p: NDArray[np.float64]) -> str:
    """A point as people say it."""
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in p) + ") mm"


def refuse_open(surface: Surface, name: str) -> None:
    """Refuses a surface that is not closed.

    Raises:
        SurfaceError: It says how many edges are open, and where.
    """
    if not len(surface.triangles) or not np.isfinite(surface.points).all():
        raise SurfaceError(f"{name}: no triangles, or points that are not finite")
    edges = open_edges(surface)
    if not len(edges):
        return
    middles = surface.points[edges].mean(axis=1)
    middle, size = middles.mean(axis=0), np.ptp(middles, axis=0).max()
    raise SurfaceError(
        f"{name}: {len(edges)} edges are open or turned, about {in_mm(middle)}, within "
        f"{1e3 * size:.0f} mm: expected a closed surface; mend: true tries to close it"
    )


def refuse_size(surface: Surface, name: str) -> None:
    """Refuses what is no organ's size: its unit is another than was told.

    Raises:
        SurfaceError: It says how large it is.
    """
    size = float(np.ptp(surface.points, axis=0).max())
    if not 5e-3 <= size <= 0.6:
        raise SurfaceError(
            f"{name}: {size:.3g} m long: expected 0.005 to 0.6 m; is its unit right?"
        )
