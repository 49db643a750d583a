"""The hard clearance: the wanted velocity, changed as little as safety asks.

With the closest points M_R at the proportion s of R and M_O at l/L of an obstacle tool,
n = unit(M_R - M_O), u along R and the tip's velocity v, the distance of the axes
changes by

    d rho/dt = A . v - n . v_O(M_O),    A = (n . u) u + s (n - (n . u) u).

It is held above D_safe by A . v >= n . v_O(M_O) - gamma (rho - D_safe), for every
obstacle tool, together with the tip's and the turning speed and the borders of the
workspace; v is the nearest velocity to the wanted one. Above the wall the shafts go on,
and may meet there: for the parts outside s and l/L are negative, and all else holds.
Trocars that breathe move R by (1 - s) of their velocity and O by (1 - l/L) of it.

*What gives way.* First of all no tool is touched; then the wall is not loaded, which is
the speeds, insertion and tilt that the trocar and the arm allow; then R's tip stays in
view; then it goes where the planner wants. Where all cannot be had, the view is left,
and port ``status`` says so; where even that will not do, the tools' rows come as near
to their bounds as the limits of the trocar permit.

*The promise and its condition.* If rho >= D_safe at the start and at every instant n .
v_O(M_O) <= e, e being the greatest A . v that the speeds and the workspace allow, the
constraint can be kept, and rho >= D_safe for ever (continuous time, exact states,
velocity followed). Where M_R is inside the shaft, n is perpendicular to u: only turning
evades, and e = s min(v_max, q omega_max); near G_R it is small. Port ``status`` says
whether the condition holds while a tool is near enough to matter.

*Dodge.* If a tool closes on the inside of the shaft with more than 0.6 e and there is
little time left to pull the tip out of its way, R retracts until it closes with less
than 0.4 e or the time is ample. So it does if a tool
that is slow enough drives it into a border of the workspace, where evasion ends.

Braking: the closing speed allowed falls as gamma (rho - D_safe), so the deceleration
asked for is at most gamma times the closing speed: gamma <= a_max / (v_max + V_O).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.organs.distance import Organs
from plants.organs.organs import OrganSet, arrays, port
from systems.bypass import obstacle_tools as tools_around
from systems.bypass import workspace as limits
from systems.bypass.distance_rate import (
    are_parallel,
    distance_rate,
    drifting,
    least_rate,
    leeway,
    less,
    outer_rate,
    tip_rates,
)
from systems.bypass.dodge import driven_time, must_dodge
from systems.bypass.hidden_tool import must_withdraw, were_seen
from systems.bypass.obstacle_tools import Margins, obstacle_tools
from systems.bypass.organ_rows import organ_rows
from systems.bypass.shadow_body import read_tool
from systems.bypass.trocar_drift import trocar_drift
from systems.bypass.workspace import VIEW, WorkspaceParams, borders
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    all_finite,
    dot,
    norm,
    row_of,
    scaled,
    set_row,
    sub,
    unit,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.projection import greatest_rate, most_missed, nearest_velocity
from systems.common.reach_limits import ReachLimits, fastest_sideways
from systems.common.signal import Many, Vector
from systems.common.signals import (
    CALM,
    FREE,
    UNHINDERED,
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
from systems.passive_wrist.wall_model import lateral_basis

_TROCAR = 6
"""Numbers that are kept of a trocar."""
_MISSED = 1e-3
"""A row is missed by more than the solver's own error, m/s."""
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
def constrain(
    params: Any,
    workspace: Any,
    view_cone: ViewCone,
    g: Vector,
    p: Vector,
    wanted: Vector,
    tools: np.ndarray,
    dodging: np.ndarray,
    drift: np.ndarray,
    organs: Organs | None = None,
    withdraws: bool = False,
) -> tuple[Vector, np.ndarray, ClearanceStatus]:
    """One step: the tip's velocity nearest to the wanted one that is safe.

    Args:
        params: A record of `constants`.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        wanted: The tip's wanted velocity, m/s.
        tools: Rows of `ObstacleTool`.
        dodging: Whether R dodges each of them, 1 or 0; as many or more.
        drift: Velocities of R's trocar and of theirs, rows, m/s; one more.
        organs: What else to keep clear of; None is compiled away.
        withdraws: Whether R dodges anyway.

    Returns:
        The tip's velocity in m/s, whether R dodges each tool, and the status.
    """
    shaft = sub(p, g)
    q, u = norm(shaft), unit(shaft)
    turning = fastest_sideways(workspace, q, params.turning_speed)
    dodges = np.zeros(len(dodging))
    least, is_near, holds, change, missed = 1e9, 0.0, 1.0, 0.0, 0.0
    dodge = 1.0 if withdraws else 0.0
    escape, blind, left = 0.0, 0.0, UNHINDERED
    e, _ = lateral_basis(u)
    near = params.obstacle_speed / params.rate
    inwards, room = borders(workspace, view_cone, g, p)
    # A tip that is outside comes back no faster than it may go at all.
    returning = np.minimum(-params.rate * room, 0.25 * params.max_speed)
    further, least_rates = inwards, returning
    if organs is not None:
        organs_inwards, organs_returning = organ_rows(params, organs, g, p, turning)
        further = np.concatenate((organs_inwards, inwards))
        least_rates = np.concatenate((organs_returning, returning))
    most = 4 * len(tools) + len(least_rates)
    rows, bounds = np.empty((most, 3)), np.empty(most)
    last = 0
    for i in range(len(tools)):
        tool = read_tool(tools[i])
        v_G, v_GO = row_of(drift, 0), row_of(drift, 1 + i)
        rate = drifting(distance_rate(g, p, tool), v_G, v_GO)
        evasion = greatest_rate(rate.A, u, params.max_speed, turning)
        least = min(least, rate.rho - tool.safe)
        if rate.rho - tool.safe < near:
            far = scaled(100.0 * params.max_speed, rate.A)
            best, _ = nearest_velocity(
                far, inwards[:VIEW], returning[:VIEW], u, params.max_speed, turning
            )
            evasion = max(0.0, min(evasion, dot(rate.A, best)))
            is_near = 1.0
            if rate.c > evasion:
                holds = 0.0
        if params.dodge and must_dodge(
            params,
            dodging[i] > 0.5,
            q,
            rate,
            tool.safe,
            dot(rate.A, u),
            evasion,
            driven_time(rate, inwards[:VIEW], room[:VIEW]),
        ):
            dodge = dodges[i] = 1.0
        left = less(left, leeway(params, rate, tool.safe, e))
        set_row(rows, last, rate.A)
        bounds[last] = least_rate(params, rate, tool.safe, evasion)
        last += 1
        if params.outside > 0.0:
            outer = drifting(outer_rate(g, p, tool, params.outside), v_G, v_GO)
            evasion = greatest_rate(outer.A, u, params.max_speed, turning)
            least = min(least, outer.rho - tool.safe)
            if outer.rho - tool.safe < near:
                is_near = 1.0
                if outer.c > evasion:
                    holds = 0.0
            left = less(left, leeway(params, outer, tool.safe, e))
            set_row(rows, last, outer.A)
            bounds[last] = least_rate(params, outer, tool.safe, evasion)
            last += 1
        if are_parallel(g, p, tool):
            for still in tip_rates(g, p, tool):
                end = drifting(still, v_G, v_GO)
                evasion = greatest_rate(end.A, u, params.max_speed, turning)
                left = less(left, leeway(params, end, tool.safe, e))
                set_row(rows, last, end.A)
                bounds[last] = least_rate(params, end, tool.safe, evasion)
                last += 1
    if dodge > 0.5:
        wanted = scaled(-params.max_speed, u)
    if params.active:
        hurried = most_missed(wanted, rows[:last], bounds[:last])
        if dodge > 0.5 or hurried > _MISSED:
            escape = 1.0
        count = last + len(least_rates)
        rows[last:count], bounds[last:count] = further, least_rates
        v, missed = nearest_velocity(
            wanted, rows[:count], bounds[:count], u, params.max_speed, turning
        )
        if dodge > 0.5 or missed > _MISSED:
            # The view, the last row, gives way.
            count -= 1
            v, missed = nearest_velocity(
                wanted, rows[:count], bounds[:count], u, params.max_speed, turning
            )
            if dot(inwards[VIEW], v) < returning[VIEW] - _MISSED:
                escape = blind = 1.0
        change = norm(sub(v, wanted))
        # Several tools and organs may ask for what cannot be had together.
        if missed > _MISSED:
            holds = 0.0
        wanted = v
    told = (least, is_near, holds, dodge, change, missed, escape, blind)
    status = ClearanceStatus(*told, left.forth, left.back)
    return wanted, dodges, status


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
    withdraws = params.active and params.dodge
    withdraws = withdraws and must_withdraw(params, g, robot.tip, tools, obstacles)
    if not all_usable(obstacles):
        if not withdraws:
            return np.zeros(len(known)), Velocity(v), CALM
        out = scaled(-s * params.max_speed, unit(sub(robot.tip, g)))
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
