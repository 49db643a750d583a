"""The signals of the perception. World frame W, plane z = 0."""

from typing import Annotated, NamedTuple

from plants.crowd.signals import ROWS
from systems.common.signal import Field, Many
from systems.switching.signals import Seen

CELLS = 100
"""Of a side of the grid."""


class Cell(NamedTuple):
    """A cell of the occupancy grid."""

    odds: Annotated[float, Field("1", "log of odds that it is occupied", 0.0)]
    x: Annotated[float, Field("m", "mean of what was hit in it", 0.0)]
    y: Annotated[float, Field("m", "mean of what was hit in it", 0.0)]


class Sureness(NamedTuple):
    """How sure the robot is of its place, in standard deviations."""

    x: Annotated[float, Field("m", "of the place", 0.01)]
    y: Annotated[float, Field("m", "of the place", 0.01)]
    theta: Annotated[float, Field("rad", "of the heading", 0.01)]


GRID = Many(Cell, tuple(map(str, range(CELLS * CELLS))))
MOVING = Many(Seen, ROWS)
"""Tracks of what moves."""
