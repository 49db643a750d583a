"""A surgeon's tool that somebody guides while the simulation runs.

What is wanted comes from outside, in steps; the tip follows as a hand would, with
bounded speed, and never comes to its fulcrum.
"""

from dataclasses import dataclass
from typing import Any

from plants.surgeon.led_tool import DEEP, STILL, LedTool, Tip, now_at
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.compiled import compiled
from systems.common.geometry import along, limited, scaled, sub
from systems.common.parameter import parameter
from systems.common.signal import Vector, finiteness, vector
from systems.common.signals import Point, Velocity

finite_point = finiteness(Point)


@dataclass
class Guidance:
    """How the hand follows what is wanted of it."""

    rate: float = parameter(8.0, "speed per distance", "1/s", above=0, most=50)
    speed: float = parameter(0.15, "of the tip at the most", "m/s", above=0, most=0.3)
    period: float = parameter(1 / 60, "of the hand's reaction", "s", above=0, most=1)


@compiled
def follow(params: Any, tip: Vector, wanted: Vector) -> Vector:
    """Velocity of the tip towards where it is wanted, m/s."""
    v = limited(scaled(params.rate, sub(wanted, tip)), params.speed)
    return v if along(tip, params.period, v)[2] <= params.p_WG[2] - DEEP else STILL


@compiled
def _react(
    params: Any, last: Tip, going: Velocity, time: float, wanted: Point
) -> tuple[Tip, Velocity]:
    tip = now_at(last, going, time)
    v = follow(params, tip, wanted.p) if finite_point(wanted) else STILL
    return Tip(tip, time), Velocity(v)


class GuidedTool(LedTool):
    """A tool in the surgeon's hand that is guided from outside, through its fulcrum.

    Port ``wanted`` accepts the `Point` where the tip is wanted; not connected, it is
    where the tip starts until somebody fixes a value. What is not finite means rest.
    Port ``shaft`` emits the tool's true `Shaft`.
    Port ``tip_velocity`` emits the tip's true `Velocity`, for the log.
    """

    def __init__(
        self, tool: SurgeonToolParams | None = None, guidance: Guidance | None = None
    ) -> None:
        """Makes the block.

        Args:
            tool: Fulcrum and first waypoint, where the tip starts.
            guidance: How the hand follows.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        tool = tool or SurgeonToolParams()
        self.lead(
            _react,
            tool,
            guidance or Guidance(),
            {"wanted": Point},
            {"wanted": Point(vector(tool.points[0]))},
        )
