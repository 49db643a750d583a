"""A surgeon's tool that chases the robot's shaft: the worst that O can do.

Nobody operates like this. It is there to test what is promised: the robot keeps clear
of a tool that always comes for it, as long as the robot can evade faster than it comes.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    closest_on_segment,
    closest_points,
    sub,
    unit,
    xyz,
)
from systems.common.signals import ROBOT_TOOL_EXAMPLE

_DEEP = 0.02
"""Least depth of the chasing tip below its fulcrum, m."""


@dataclass
class Hunt:
    """A chase of the robot's shaft.

    Attributes:
        speed: Of the tip, m/s; 0 for none: the tool then moves as usual.
        start: When it begins, s.
        end: When it ends, s.
        from_fulcrum: The shaft stays this far from the robot's fulcrum, m.
        period: Of the pursuer's reaction, s.
    """

    speed: float = 0.0
    start: float = 0.5
    end: float = 1e3
    from_fulcrum: float = 0.03
    period: float = 1.0 / 60.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        for name in ("speed", "start", "from_fulcrum"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f"hunt: {name}={value} must be finite and >= 0")
        if not self.period > 0.0:
            raise ValueError(f"hunt: period={self.period} s must be > 0")
        if not self.start <= self.end:
            raise ValueError(
                f"hunt: end={self.end} s must not come before start={self.start} s"
            )


@compiled
def pursue(params: Any, g_o: Vector, tip: Vector, g: Vector, p: Vector) -> Vector:
    """Velocity of the chasing tip, m/s: M_O goes for M_R.

    Args:
        params: A record of a `Hunt`.
        g_o: Fulcrum G_O, m.
        tip: Tip of O, m.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
    """
    _, _, _, m_r, m_o = closest_points(g, p, g_o, tip)
    v = along((0.0, 0.0, 0.0), params.speed, unit(sub(m_r, m_o)))
    ahead = along(tip, params.period, v)
    now, then = closest_on_segment(g, g_o, tip)[1], closest_on_segment(g, g_o, ahead)[1]
    too_near = then < params.from_fulcrum and then < now
    if too_near or ahead[2] > g_o[2] - _DEEP:
        return 0.0, 0.0, 0.0
    return v


@compiled
def _next(
    record: np.ndarray, state: np.ndarray, time: float, g_o: Vector, tool: np.ndarray
) -> np.ndarray:
    params = record[0]
    tip = along(xyz(state, 0), time - state[6], xyz(state, 3))
    v = (0.0, 0.0, 0.0)
    if params.start <= time < params.end and all_finite(tool):
        v = pursue(params, g_o, tip, xyz(tool, 0), xyz(tool, 3))
    return np.array(tip + v + (time,))


@compiled
def _shaft(state: np.ndarray, time: float, g_o: Vector) -> np.ndarray:
    tip = along(xyz(state, 0), time - state[6], xyz(state, 3))
    return np.array(tip + unit(sub(tip, g_o)))


class HuntingTool(Block):
    """A tool in the surgeon's hand that chases the robot's shaft, through its fulcrum.

    Port ``robot_tool`` accepts the robot's instrument: fulcrum G_R and tip P_R
    (6), m, in W. Port ``shaft`` emits the tool's true shaft (6): tip p_WP in m and unit
    vector u_W, in W. Port ``tip_velocity`` emits the tip's true velocity v_WP (3), m/s,
    in W, for the log.

    The discrete state is tip (3), its velocity (3) and the time they hold at.

    Args:
        tool: Fulcrum and first waypoint, where the tip starts.
        hunt: The chase.

    Raises:
        ValueError: If a parameter is out of range.
    """

    def __init__(
        self, tool: SurgeonToolParams | None = None, hunt: Hunt | None = None
    ) -> None:
        super().__init__()
        tool, hunt = tool or SurgeonToolParams(), hunt or Hunt(speed=0.02)
        tool.check()
        hunt.check()
        self._constants = packed(hunt)
        x, y, z = tool.p_WG
        self._p_WG = (float(x), float(y), float(z))
        self._robot_tool = self.vector_in("robot_tool", ROBOT_TOOL_EXAMPLE)
        self.DeclareDiscreteState(np.array([*tool.points[0], 0.0, 0.0, 0.0, 0.0]))
        moving = {self.xd_ticket(), self.time_ticket()}
        self.vector_out("shaft", 6, self._calc_shaft, moving)
        self.vector_out("tip_velocity", 3, self._calc_velocity, {self.xd_ticket()})
        self.update_every(hunt.period, self._update)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        state = context.get_discrete_state_vector().value()
        return _shaft(state, context.get_time(), self._p_WG)

    def _calc_velocity(self, context: Any) -> np.ndarray:
        return context.get_discrete_state_vector().value()[3:6]

    def _update(self, context: Any) -> np.ndarray:
        return _next(
            self._constants,
            context.get_discrete_state_vector().value(),
            context.get_time(),
            self._p_WG,
            self._robot_tool.Eval(context),
        )
