"""The signals of an operation through one trocar. World frame W, SI units.

Frame E stands at the entry of the organ that is operated, z into it; frame C is the
snake's channel, `gap` beyond the tube's end, z along the tube.
"""

from typing import Annotated, NamedTuple

from systems.common.signal import Field, Vector


class Phase(NamedTuple):
    """Where an operation stands."""

    code: Annotated[float, Field("1", "a `phases.Phases`", 0.0)]
    since: Annotated[float, Field("s", "when it was entered", 0.0)]
    reason: Annotated[float, Field("1", "why: a `phases.Reason`", 0.0)]
    pace: Annotated[float, Field("1", "share of its speed that the tube may have", 1.0)]


class TubePose(NamedTuple):
    """The tube, as its joints have it."""

    p: Annotated[Vector, Field("m", "p_WP of its end", (0.0, 0.0, -0.08))]
    x: Annotated[Vector, Field("1", "x axis of C", (1.0, 0.0, 0.0))]
    z: Annotated[Vector, Field("1", "along it, z axis of C", (0.0, 0.0, -1.0))]


class TubeStatus(NamedTuple):
    """How the tube stands to its station."""

    distance: Annotated[float, Field("m", "of its end from the station", 0.0)]
    speed: Annotated[float, Field("m/s", "against it", 0.0)]


class BodyDeviation(NamedTuple):
    """How far the snake's body is from its plan, because the tube is from its own."""

    distance: Annotated[float, Field("m", "of what is in the organ, at the most", 2e-5)]


class SnakeStatus(NamedTuple):
    """How far the snake is."""

    out: Annotated[float, Field("1", "share of its way from the tube to the plan", 0.0)]
    advance: Annotated[float, Field("m", "of the tube from its station", 0.0)]
    rate: Annotated[float, Field("m/s", "of that", 0.0)]
    clock: Annotated[float, Field("s", "of the plan that is done", 0.0)]
    left: Annotated[float, Field("s", "of the plan that is not", 1.0)]
    retreat: Annotated[float, Field("1", "how far the tool has drawn back", 0.0)]
