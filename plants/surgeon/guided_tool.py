"""A surgeon's tool that somebody guides while the simulation runs.

What is wanted comes from outside, in steps; the tip follows as a hand would, with
bounded speed, and never comes to its fulcrum.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, limited, scaled, sub, unit
from systems.common.parameter import check, parameter
from systems.common.signal import Vector, finiteness, vector
from systems.common.signals import Point, Shaft, Velocity
from systems.common.step_block import StepBlock, wired

_DEEP = 0.02
"""Least depth of the tip below its fulcrum, m."""
_STILL = (0.0, 0.0, 0.0)
finite_point = finiteness(Point)


@dataclass
class Guidance:
    """How the hand follows what is wanted of it."""

    rate: float = parameter(8.0, "speed per distance", "1/s", above=0, most=50)
    speed: float = parameter(0.15, "of the tip at the most", "m/s", above=0, most=0.3)
    period: float = parameter(1 / 60, "of the hand's reaction", "s", above=0, most=1)


class Tip(NamedTuple):
    """Place of the tip at the last reaction, in m, and the time of it in s."""

    p: Vector
    time: float


@compiled
def follow(params: Any, tip: Vector, wanted: Vector) -> Vector:
    """Velocity of the tip towards where it is wanted, m/s."""
    v = limited(scaled(params.rate, sub(wanted, tip)), params.speed)
    return v if along(tip, params.period, v)[2] <= params.p_WG[2] - _DEEP else _STILL


@compiled
def _react(
    params: Any, last: Tip, going: Velocity, time: float, wanted: Point
) -> tuple[Tip, Velocity]:
    tip = along(last.p, time - last.time, going.v)
    v = follow(params, tip, wanted.p) if finite_point(wanted) else _STILL
    return Tip(tip, time), Velocity(v)


@compiled
def _shaft(params: Any, last: Tip, going: Velocity, time: float) -> tuple[Shaft]:
    tip = along(last.p, time - last.time, going.v)
    return (Shaft(tip, unit(sub(tip, params.p_WG))),)


class GuidedTool(StepBlock):
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
        tool, guidance = tool or SurgeonToolParams(), guidance or Guidance()
        check(tool)
        check(guidance)
        self._constants = packed(guidance, p_WG=vector(tool.p_WG))
        first = vector(tool.points[0])
        start = {"_tip": Tip(first, 0.0), "tip_velocity": Velocity(_STILL)}
        self.declare_update(
            _react,
            [self._constants],
            {"wanted": Point},
            start,
            guidance.period,
            defaults={"wanted": Point(first)},
        )
        self._place = wired(_shaft, 1, [Tip, Velocity], [], [Shaft], True)
        moving = {self.xd_ticket(), self.time_ticket()}
        self.signal_out("shaft", Shaft, self._calc_shaft, moving)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        groups = [context.get_discrete_state(group).value() for group in range(2)]
        return self._place(self._constants, *groups, context.get_time())
