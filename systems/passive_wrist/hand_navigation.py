"""The arm led by a hand: the tip goes where it is wanted, through the fulcrum.

As `ArcNavigation`, with a wanted place instead of a script: the tip's velocity is
bounded, the shaft turns about the fulcrum that the planner believes in.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, limited, norm, over, scaled, sub
from systems.common.parameter import check, parameter
from systems.common.signal import vector
from systems.common.signals import Permission, Point, ToolMotion
from systems.common.step_block import StepBlock
from systems.passive_wrist.arc_navigation import finite_permission, finite_point

_STILL = (0.0, 0.0, 0.0)
_LEAST = 0.02  # m, of the tip from its fulcrum


@dataclass
class HandNavigationParams:
    """Parameters of `HandNavigation`."""

    rate: float = parameter(4.0, "speed per distance", "1/s", above=0, most=20)
    speed: float = parameter(0.04, "of the tip at the most", "m/s", above=0, most=0.2)
    period: float = parameter(1 / 60, "of the update", "s", above=0, most=0.1)


@compiled
def _lead(
    params: Any,
    tool: ToolMotion,
    time: float,
    fulcrum: Point,
    permission: Permission,
    wanted: Point,
) -> tuple[ToolMotion]:
    tip = along(tool.tip, time - tool.time, tool.v)
    good = finite_point(fulcrum) and finite_permission(permission)
    if not (good and finite_point(wanted)):  # hold still
        return (ToolMotion(tip, tool.u, _STILL, _STILL, time),)
    away = sub(tip, fulcrum.p)
    reach = norm(away)
    v = limited(scaled(params.rate, sub(wanted.p, tip)), params.speed)
    v = scaled(permission.speed_scale, v)
    if norm(sub(along(tip, params.period, v), fulcrum.p)) < _LEAST:
        v = _STILL
    u = over(away, reach)
    return (ToolMotion(tip, u, v, over(across(v, u), reach), time),)


class HandNavigation(StepBlock):
    """Moves the tip to where it is wanted.

    Port ``fulcrum`` accepts p_WG, the `Point` believed in.

    Port ``permission`` accepts the `Permission` of the passive wrist.

    Port ``wanted`` accepts the `Point` where the tip is wanted.

    Port ``tool`` emits the commanded `ToolMotion`.
    """

    def __init__(
        self,
        params: HandNavigationParams | None = None,
        p_WP: Sequence[float] = (0.0, 0.0, -0.18),
        p_WG: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Makes the block with the tip at p_WP and its fulcrum at p_WG [m]."""
        super().__init__()
        params = params or HandNavigationParams()
        check(params)
        away = sub(vector(p_WP), vector(p_WG))
        u = over(away, norm(away))
        self.declare_update(
            _lead,
            [packed(params)],
            {"fulcrum": Point, "permission": Permission, "wanted": Point},
            {"tool": ToolMotion(vector(p_WP), u, _STILL, _STILL, 0.0)},
            params.period,
        )
