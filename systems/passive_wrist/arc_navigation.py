"""A scripted task for the wrist: altitude arcs about the fulcrum (Figure 3).

Figure 3's instrument turns from A to B about the fulcrum that the planner believes
in. The tip's velocity is the arc's about that point,

    v_P = omega(t) x (p_P - p_G),

integrated from the tip's own start: no jump of the estimate moves the tip.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi
from typing import Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, cross, norm, over, scaled, sub
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import finiteness, vector
from systems.common.signals import Permission, Point, ToolMotion
from systems.common.step_block import StepBlock

_STILL = (0.0, 0.0, 0.0)
finite_permission, finite_point = finiteness(Permission), finiteness(Point)


@dataclass
class ArcParams:
    """Parameters of `ArcNavigation`."""

    angle: float = parameter(
        0.0, "of the swing to either side; 0 stands still", "rad", least=0, most=0.6
    )
    swing: float = parameter(8.0, "time of one to and fro", "s", least=1, most=600)
    start: float = parameter(0.0, "of the motion", "s", least=0, most=1e4)
    axis: list[float] = parameter(
        [0.0, 1.0, 0.0], "in W, about which it turns", least=-10, most=10, shape=(3,)
    )
    period: float = parameter(1 / 60, "of the update", "s", above=0, most=0.1)

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield any(self.axis), "axis", "a direction, not zero"


class Script(NamedTuple):
    """How far the script has got, in s."""

    done: float


@compiled
def rate(params: Any, done: float) -> float:
    """Angular rate in rad/s of the sine swing, `done` s after its start."""
    if done <= 0.0:
        return 0.0
    # The rate grows over half a second; before that the arm stands.
    soft = 0.5 - 0.5 * cos(pi * min(done / 0.5, 1.0))
    swing = params.swing
    return soft * params.angle * 2.0 * pi / swing * cos(2.0 * pi * done / swing)


@compiled
def _swing(
    params: Any,
    tool: ToolMotion,
    script: Script,
    time: float,
    fulcrum: Point,
    permission: Permission,
) -> tuple[ToolMotion, Script]:
    tip = along(tool.tip, time - tool.time, tool.v)
    if not (finite_point(fulcrum) and finite_permission(permission)):  # hold still
        return ToolMotion(tip, tool.u, _STILL, _STILL, time), script
    pace = permission.speed_scale
    done = script.done + (pace * params.period if time >= params.start else 0.0)
    away = sub(tip, fulcrum.p)
    v = scaled(pace * rate(params, done), cross(params.direction, away))
    reach = norm(away)
    u = over(away, reach)
    return ToolMotion(tip, u, v, over(across(v, u), reach), time), Script(done)


class ArcNavigation(StepBlock):
    """Moves the tip on arcs about the fulcrum it is told.

    Port ``fulcrum`` accepts p_WG, the `Point` believed in.

    Port ``permission`` accepts the `Permission` of the passive wrist.

    Port ``tool`` emits the commanded `ToolMotion`.
    """

    def __init__(
        self,
        params: ArcParams | None = None,
        p_WP: Sequence[float] = (0.0, 0.0, -0.18),
        p_WG: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Makes the block with the tip at p_WP and its fulcrum at p_WG [m]."""
        super().__init__()
        params = params or ArcParams()
        check(params, "arcs")
        axis = vector(params.axis)
        away = sub(vector(p_WP), vector(p_WG))
        u = over(away, norm(away))
        tool = ToolMotion(vector(p_WP), u, _STILL, _STILL, 0.0)
        self.declare_update(
            _swing,
            [packed(params, direction=over(axis, norm(axis)))],
            {"fulcrum": Point, "permission": Permission},
            {"tool": tool, "_script": Script(0.0)},
            params.period,
        )
