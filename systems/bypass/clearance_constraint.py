"""The block behind the fuzzy sum that keeps clear of tools; see `safe_velocity`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.organs.distance import Organs
from plants.organs.organs import OrganSet, arrays, port
from systems.bypass import obstacle_tools as tools_around
from systems.bypass import workspace as limits
from systems.bypass.hidden_tool import were_seen, withdrawal
from systems.bypass.obstacle_tools import Margins, obstacle_tools
from systems.bypass.safe_velocity import constrain
from systems.bypass.trocar_drift import trocar_drift
from systems.bypass.workspace import WorkspaceParams
from systems.common.compiled import compiled, packed
from systems.common.geometry import all_finite, scaled, sub, unit
from systems.common.parameter import Rules, check, parameter
from systems.common.reach_limits import ReachLimits
from systems.common.signal import Many
from systems.common.signals import (
    CALM,
    FREE,
    ClearanceStatus,
    Estimate,
    Guide,
    Permission,
    RobotTool,
    Velocity,
    ViewCone,
    all_usable,
    finite_cone,
    finite_guide,
    finite_tool,
    usable,
)
from systems.common.step_block import StepBlock

_TROCAR = 6
"""Numbers that are kept of a trocar."""
_WITHDRAWS = CALM._replace(dodge=1.0, escape=1.0)
"""What the constraint does where a lost tool may come."""


@dataclass
class ClearanceConstraintParams:
    """Parameters of `ClearanceConstraint`."""

    active: bool = parameter(
        True, "if not, the velocity passes unchanged; the status is still given"
    )
    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    # The planner's own speed is lower. A PA-10's joints allow this in the middle of
    # its workspace; where they do not, the tip lags and the fulcrum is kept.
    max_speed: float = parameter(
        0.25, "v_max that evasion may use", "m/s", above=0.0, most=0.5
    )
    turning_speed: float = parameter(
        1.0, "omega_max of the shaft", "rad/s", above=0.0, most=10.0
    )
    acceleration: float = parameter(
        4.0,
        "of the tip in evasion, that dodging reckons with",
        "m/s^2",
        least=0.1,
        most=20.0,
    )
    rate: float = parameter(
        4.0, "gamma; at most a_max / (v_max + V_O)", "1/s", least=0.1, most=60.0
    )
    obstacle_speed: float = parameter(
        0.06,
        "V_O to be reckoned with: within D_safe + V_O / gamma a tool counts as near",
        "m/s",
        least=0.01,
        most=0.5,
    )
    dodge: bool = parameter(True, "whether to dodge")
    drift_time: float = parameter(
        0.0,
        "over which the trocars' own velocities are found; 0: they stand",
        "s",
        least=0.0,
        most=5.0,
    )
    outside: float = parameter(
        0.3,
        "length of the shafts outside the body that counts; 0: none",
        "m",
        least=0.0,
        most=0.6,
    )

    def rules(self) -> Rules:
        """What must hold across the parameters."""
        fastest = 0.5 / self.period
        yield self.rate <= fastest, "rate", f"at most 0.5 / period = {fastest:.4g} /s"


def constants(params: ClearanceConstraintParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


@compiled
def hold(
    params: Any,
    margins: Any,
    workspace: Any,
    organs: Organs | None,
    known: np.ndarray,
    v_R: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
    permission: Permission,
) -> tuple[np.ndarray, Velocity, ClearanceStatus]:
    """One step of the block, among organs or, None, without."""
    v = v_R.v if all_finite(v_R.v) else (0.0, 0.0, 0.0)
    numbers = finite_guide(guide) and finite_tool(robot) and finite_cone(view_cone)
    if not (numbers and were_seen(obstacles)):
        return np.zeros(len(known)), Velocity(v), CALM
    g, s = robot.fulcrum, guide.s
    tools = obstacle_tools(margins, g, obstacles, target, camera)
    withdraws = 0.0
    if params.active and params.dodge:
        withdraws = withdrawal(params, workspace, g, robot.tip, tools, obstacles)
    if not all_usable(obstacles):
        if withdraws == 0.0:
            return np.zeros(len(known)), Velocity(v), CALM
        out = scaled(-s * withdraws, unit(sub(robot.tip, g)))
        return np.zeros(len(known)), Velocity(out), _WITHDRAWS
    count = len(known) // (1 + _TROCAR)
    after = known.copy()
    places = after[count:].reshape((count, _TROCAR))
    if params.drift_time > 0.0:
        places[:] = trocar_drift(params, places, g, tools)
    share = max(0.0, min(1.0, permission.speed_scale)) / s
    if not usable(target):  # nowhere to go, but out of the others' way
        share = 0.0
    v, dodges, status = constrain(
        params,
        workspace,
        view_cone,
        g,
        robot.tip,
        scaled(share, v),
        tools,
        known[: count - 1],
        places[:, 3:],
        organs,
        withdraws,
    )
    after[: count - 1] = dodges
    return after, Velocity(scaled(s, v)), status


@compiled
def _step(
    params: Any,
    margins: Any,
    workspace: Any,
    state: np.ndarray,
    v_R: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
    permission: Permission,
) -> tuple[np.ndarray, Velocity, ClearanceStatus]:
    known = (robot, obstacles, target, camera, view_cone, permission)
    return hold(params, margins, workspace, None, state, v_R, guide, *known)


@compiled
def _step_among(
    params: Any,
    margins: Any,
    workspace: Any,
    values: np.ndarray,
    table: np.ndarray,
    state: np.ndarray,
    v_R: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
    permission: Permission,
    moved: np.ndarray,
) -> tuple[np.ndarray, Velocity, ClearanceStatus]:
    organs = Organs(values, table, moved)
    known = (robot, obstacles, target, camera, view_cone, permission)
    return hold(params, margins, workspace, organs, state, v_R, guide, *known)


class ClearanceConstraint(StepBlock):
    """Holds a hard clearance to the surgeon's tools under any planner.

    After the fuzzy sum, before the tool's navigation; see the module. While an input
    is not finite or a tool was never seen the velocity passes as it is: then the
    arbiter slows R down and the navigation stops it. So it does while a tool is lost,
    until R must withdraw (`hidden_tool`). While S is lost R only evades. A wanted
    velocity that is not finite counts as zero.

    Port ``v_R`` accepts the wanted `Velocity` of the guide point.
    Port ``guide`` accepts the `Guide`, of which s is used.
    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool.
    Port ``target`` accepts the `Estimate` of the target tool S.
    Port ``camera`` accepts the `Estimate` of the endoscope.
    Port ``view_cone`` accepts the `ViewCone`.
    Port ``permission`` accepts the passive wrist's `Permission`; free without a wire.
    Evasion is not slowed.
    Port ``organs``, if there are any, accepts the `MovingPoint` of each.
    Port ``v_safe`` emits the `Velocity` of the guide point.
    Port ``status`` emits the `ClearanceStatus`.

    The discrete state is whether R dodges each tool, the obstacles, S, the endoscope,
    and where R's trocar and theirs are and how fast they move.
    """

    def __init__(
        self,
        params: ClearanceConstraintParams | None = None,
        margins: Margins | None = None,
        reach: ReachLimits | None = None,
        workspace: WorkspaceParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
        organs: OrganSet | None = None,
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            margins: Distances to the tools; the defaults if None.
            reach: What the navigation behind it keeps to; the defaults if None.
            workspace: Further limits of R's tip; the defaults if None.
            obstacles: Names of the obstacle tools.
            organs: What else to keep clear of; nothing if None.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or ClearanceConstraintParams()
        self.declare_step(
            _step if organs is None else _step_among,
            [
                constants(params),
                tools_around.constants(margins or Margins()),
                limits.constants(reach, workspace),
                *arrays(organs),
            ],
            {
                "v_R": Velocity,
                "guide": Guide,
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "target": Estimate,
                "camera": Estimate,
                "view_cone": ViewCone,
                "permission": Permission,
                **port(organs),
            },
            np.zeros((len(obstacles) + 3) * (1 + _TROCAR)),
            {"v_safe": Velocity, "status": ClearanceStatus},
            params.period,
            timed=False,
            defaults={"permission": FREE},
        )
