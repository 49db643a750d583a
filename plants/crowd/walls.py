"""What stands on the floor with straight sides: walls, and bodies of any outline."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist

import numpy as np

from systems.common.parameter import Rules, parameter

CAPACITY = 64
"""Number of straight pieces that there is room for."""


@dataclass
class WallParams:
    """A chain of straight walls."""

    points: list[list[float]] = parameter(
        [[0.0, 1.0], [1.0, 1.0]],
        "its corners x, y, one after the other",
        "m",
        shape=(-1, 2),
        least=-100.0,
        most=100.0,
    )
    solid: bool = parameter(
        False, "whether it is the outline of a body: closed, with nothing inside"
    )

    def rules(self) -> Rules:
        """A wall has two ends, and an outline closes."""
        yield len(self.points) >= 2, "points", "at least two"
        if self.solid:
            gap = dist(self.points[0], self.points[-1])
            yield (
                gap == 0.0 and len(self.points) >= 4,
                "points",
                f"an outline that ends where it begins; it is {gap:.3g} m open",
            )


def segments(walls: Sequence[WallParams]) -> np.ndarray:
    """All straight pieces, rows of x, y, x, y [m], (CAPACITY, 4); zeros follow them.

    Raises:
        ValueError: If there are too many.
    """
    pieces = [[*a, *b] for wall in walls for a, b in pairwise(wall.points)]
    if len(pieces) > CAPACITY:
        raise ValueError(f"walls: {len(pieces)} pieces: expected <= {CAPACITY}")
    table = np.zeros((CAPACITY, 4))
    table[: len(pieces)] = np.reshape(pieces, (-1, 4))
    return table


def wall_distance(walls: Sequence[WallParams], places: np.ndarray) -> np.ndarray:
    """Distance (n,) of places (n, 2) from the nearest wall [m].

    It is zero within a body, and infinite if there are no walls.
    """
    places = np.reshape(places, (-1, 2))
    least = np.full(len(places), np.inf)
    for wall in walls:
        inside = np.zeros(len(places), bool)
        for a, b in pairwise(np.asarray(wall.points, float)):
            e, q = b - a, places - a
            share = np.clip(q @ e / max(e @ e, 1e-12), 0.0, 1.0)
            least = np.minimum(least, np.hypot(*(q - share[:, None] * e).T))
            over = (a[1] > places[:, 1]) != (b[1] > places[:, 1])
            rise = e[1] if e[1] != 0.0 else 1.0
            inside ^= over & (places[:, 0] < a[0] + e[0] * q[:, 1] / rise)
        if wall.solid:
            least[inside] = 0.0
    return least
