"""The signals that the navigation's blocks exchange. World frame W, plane z = 0."""

from typing import Annotated, NamedTuple

from plants.crowd.signals import ROWS
from systems.common.signal import Field, Many


class Seen(NamedTuple):
    """An obstacle in sight."""

    track: Annotated[float, Field("1", "its identity, -1 for nothing", 0.0)]
    x: Annotated[float, Field("m", "of its centre", 2.0)]
    y: Annotated[float, Field("m", "of its centre", 0.4)]
    radius: Annotated[float, Field("m", "R_i", 0.3)]
    v_x: Annotated[float, Field("m/s", "velocity", 0.0)]
    v_y: Annotated[float, Field("m/s", "velocity", -0.3)]


class Corner(NamedTuple):
    """An edge behind which the robot does not see."""

    there: Annotated[float, Field("1", "1 if there is one", 1.0)]
    x: Annotated[float, Field("m", "of the edge", 1.5)]
    y: Annotated[float, Field("m", "of the edge", 0.8)]


class Noise(NamedTuple):
    """What an obstacle's measurement is wrong by, in standard deviations."""

    x: Annotated[float, Field("1", "of its centre", 0.5)]
    y: Annotated[float, Field("1", "of its centre", -0.5)]
    v_x: Annotated[float, Field("1", "of its velocity", 0.5)]
    v_y: Annotated[float, Field("1", "of its velocity", -0.5)]


class Goal(NamedTuple):
    """Where the robot shall go."""

    x: Annotated[float, Field("m", "place", 8.0)]
    y: Annotated[float, Field("m", "place", 0.0)]


class PlanarVelocity(NamedTuple):
    """The velocity that the robot shall take."""

    x: Annotated[float, Field("m/s", "velocity", 0.4)]
    y: Annotated[float, Field("m/s", "velocity", 0.3)]


class Mode(NamedTuple):
    """What a planner is about."""

    state: Annotated[float, Field("1", "its number in the planner's states", 0.0)] = 0.0
    track: Annotated[float, Field("1", "obstacle followed, -1 for none", -1.0)] = -1.0
    side: Annotated[float, Field("1", "+1 counter-clockwise about it", 1.0)] = 1.0
    retreat: Annotated[float, Field("1", "1 if it may drive backwards", 0.0)] = 0.0
    outrun: Annotated[
        float, Field("1", "1 if an obstacle in sight is as fast as the body", 0.0)
    ] = 0.0


STANDING = 64
"""Number of points of what stands that there is room for, beside the obstacles."""
SEEN = Many(Seen, (*ROWS, *(f"s{k}" for k in range(STANDING))))
EDGES = 12
"""Number of corners that there is room for."""
CORNERS = Many(Corner, tuple(map(str, range(EDGES))))
NOISE = Many(Noise, ROWS)
