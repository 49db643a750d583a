"""A surgeon's tool that chases the robot's shaft: the worst that O can do.

Nobody operates like this. It is there to test what is promised: the robot keeps clear
of a tool that always comes for it, as long as the robot can evade faster than it comes.
"""

from dataclasses import dataclass
from typing import Any

from plants.surgeon.led_tool import DEEP, STILL, LedTool, Tip, now_at
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.compiled import compiled
from systems.common.geometry import (
    along,
    closest_on_segment,
    closest_points,
    scaled,
    sub,
    unit,
    xyz,
)
from systems.common.parameter import Rules, parameter
from systems.common.signal import Vector
from systems.common.signals import RobotTool, Velocity, finite_tool


@dataclass
class Hunt:
    """A chase of the robot's shaft."""

    # 0 for none: the tool then moves as usual.
    speed: float = parameter(0.0, "of the tip", "m/s", least=0, most=0.3)
    start: float = parameter(0.5, "when it begins", "s", least=0, most=1e4)
    end: float = parameter(1e3, "when it ends", "s", least=0, most=1e4)
    from_fulcrum: float = parameter(
        0.03, "that the shaft stays off the robot's", "m", least=0, most=0.2
    )
    period: float = parameter(1 / 60, "of the pursuer's reaction", "s", above=0, most=1)

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield self.start <= self.end, "end", f">= start, {self.start} s"


@compiled
def pursue(params: Any, g_o: Vector, tip: Vector, robot: RobotTool) -> Vector:
    """Velocity of the chasing tip, m/s: M_O goes for M_R.

    Args:
        params: A record of a `Hunt`.
        g_o: Fulcrum G_O, m.
        tip: Tip of O, m.
        robot: The robot's tool.
    """
    g = robot.fulcrum
    _, _, _, m_r, m_o = closest_points(g, robot.tip, g_o, tip)
    v = scaled(params.speed, unit(sub(m_r, m_o)))
    ahead = along(tip, params.period, v)
    now, then = closest_on_segment(g, g_o, tip)[1], closest_on_segment(g, g_o, ahead)[1]
    too_near = then < params.from_fulcrum and then < now
    if too_near or ahead[2] > g_o[2] - DEEP:
        return STILL
    return v


@compiled
def _react(
    params: Any, last: Tip, going: Velocity, time: float, robot: RobotTool
) -> tuple[Tip, Velocity]:
    tip, v = now_at(last, going, time), STILL
    if params.start <= time < params.end and finite_tool(robot):
        v = pursue(params, xyz(params.p_WG, 0), tip, robot)
    return Tip(tip, time), Velocity(v)


class HuntingTool(LedTool):
    """A tool in the surgeon's hand that chases the robot's shaft, through its fulcrum.

    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``shaft`` emits the tool's true `Shaft`.
    Port ``tip_velocity`` emits the tip's true `Velocity`, for the log.
    """

    def __init__(
        self, tool: SurgeonToolParams | None = None, hunt: Hunt | None = None
    ) -> None:
        """Makes the block.

        Args:
            tool: Fulcrum and first waypoint, where the tip starts.
            hunt: The chase.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        hunt = hunt or Hunt(speed=0.02)
        self.lead(_react, tool or SurgeonToolParams(), hunt, {"robot_tool": RobotTool})
