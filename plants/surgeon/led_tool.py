"""The base of a surgeon's tool that is led from one reaction to the next.

Between two reactions of the hand the tip goes on as it goes; the shaft runs through the
fulcrum. What leads it is the step of those that derive from it.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, sub, unit
from systems.common.parameter import check
from systems.common.signal import Vector, vector
from systems.common.signals import Shaft, Velocity
from systems.common.step_block import StepBlock, wired

DEEP = 0.02
"""Least depth of the tip below its fulcrum, m."""
STILL = (0.0, 0.0, 0.0)


class Tip(NamedTuple):
    """Place of the tip at the last reaction, in m, and the time of it in s."""

    p: Vector
    time: float


@compiled
def now_at(last: Tip, going: Velocity, time: float) -> Vector:
    """Where the tip is at a time in s."""
    return along(last.p, time - last.time, going.v)


@compiled
def _shaft(params: Any, last: Tip, going: Velocity, time: float) -> tuple[Shaft]:
    tip = now_at(last, going, time)
    return (Shaft(tip, unit(sub(tip, params.p_WG))),)


class LedTool(StepBlock):
    """A tool in the surgeon's hand; ports as of those that derive from it."""

    def lead(
        self,
        react: Callable[..., Any],
        tool: SurgeonToolParams,
        params: Any,
        inputs: Mapping[str, Any],
        defaults: Mapping[str, Any] | None = None,
    ) -> None:
        """Declares ports, state and update.

        Args:
            react: Compiled, of a record of `params` with the fulcrum `p_WG`, `Tip`,
                `Velocity`, time and inputs; returns the next tip and velocity.
            tool: Fulcrum and first waypoint, where the tip starts.
            params: What leads it, with a `period` in s.
            inputs: Ports and their signals.
            defaults: Values of ports that need not be connected.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        check(tool)
        check(params)
        self._constants = packed(params, p_WG=vector(tool.p_WG))
        start = {
            "_tip": Tip(vector(tool.points[0]), 0.0),
            "tip_velocity": Velocity(STILL),
        }
        self.declare_update(
            react, [self._constants], inputs, start, params.period, defaults=defaults
        )
        self._place = wired(_shaft, 1, [Tip, Velocity], [], [Shaft], True)
        moving = {self.xd_ticket(), self.time_ticket()}
        self.signal_out("shaft", Shaft, self._calc_shaft, moving)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        groups = [context.get_discrete_state(group).value() for group in range(2)]
        shaft: np.ndarray = self._place(self._constants, *groups, context.get_time())
        return shaft
