"""What moves about on the floor, as a signal. World frame W, plane z = 0."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from systems.common.signal import Field, Many, size

CAPACITY = 40
"""Number of obstacles that the signals have room for."""

ROWS = tuple(map(str, range(CAPACITY)))
"""Names of the obstacles."""


class Obstacle(NamedTuple):
    """A disc on the floor and how it moves; a radius of zero is nothing."""

    x: Annotated[float, Field("m", "of its centre", 2.0)]
    y: Annotated[float, Field("m", "of its centre", 0.4)]
    radius: Annotated[float, Field("m", "R_i", 0.3)]
    v_x: Annotated[float, Field("m/s", "velocity", 0.0)]
    v_y: Annotated[float, Field("m/s", "velocity", -0.3)]


OBSTACLES = Many(Obstacle, ROWS)


def filled(obstacles: Sequence[Obstacle]) -> np.ndarray:
    """Obstacles as a port of `OBSTACLES` has them: nothing follows them."""
    table = np.zeros((CAPACITY, size(Obstacle)))
    if obstacles:
        table[: len(obstacles)] = obstacles
    return table.ravel()
