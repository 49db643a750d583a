"""The signals of the mobile robot's body."""

from typing import Annotated, NamedTuple

from systems.common.signal import Field


class RobotState(NamedTuple):
    """The body: where it is and how it moves. World frame W, plane z = 0."""

    x: Annotated[float, Field("m", "place", 0.0)]
    y: Annotated[float, Field("m", "place", 0.0)]
    theta: Annotated[float, Field("rad", "heading", 0.0)]
    v: Annotated[float, Field("m/s", "speed, negative backwards", 0.5)]
    omega: Annotated[float, Field("rad/s", "turn rate", 0.0)]


class Command(NamedTuple):
    """What the body is to do."""

    speed: Annotated[float, Field("m/s", "speed to take", 0.5)]
    turn_rate: Annotated[float, Field("rad/s", "turn rate to take", 0.0)]
