"""The hard clearance: the wanted velocity, changed as little as safety asks.

With the closest points M_R at the proportion s of R and M_O at l/L of an obstacle tool,
n = unit(M_R - M_O), u along R and the tip's velocity v, the distance of the axes
changes by

    d rho/dt = A . v - n . v_O(M_O),    A = (n . u) u + s (n - (n . u) u).

It is held above D_safe by A . v >= n . v_O(M_O) - gamma (rho - D_safe), for every
obstacle tool, together with the tip's and the turning speed and the borders of the
workspace; v is the nearest velocity to the wanted one.

*The promise and its condition.* If rho >= D_safe at the start and at every instant n .
v_O(M_O) <= e, e being the greatest A . v that the speeds and the workspace allow, the
constraint can be kept, and rho >= D_safe for ever (continuous time, exact states,
velocity followed). Where M_R is inside the shaft, n is perpendicular to u: only turning
evades, and e = s min(v_max, q omega_max); near G_R it is small. Port ``status`` says
whether the condition holds while a tool is near enough to matter.

*Dodge.* If a tool closes on the inside of the shaft with more than 0.6 e and there is
little time left to pull the tip out of its way, R retracts until it closes with less
than 0.4 e or the time is ample.

Braking: the closing speed allowed falls as gamma (rho - D_safe), so the deceleration
asked for is at most gamma times the closing speed: gamma <= a_max / (v_max + V_O).
"""

from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import numpy as np

from systems.bypass import obstacle_tools as tools_around
from systems.bypass import workspace as limits
from systems.bypass.obstacle_tools import Margins, obstacle_tools
from systems.bypass.shadow_body import FULCRUM, SAFE, TIP, VELOCITY
from systems.bypass.workspace import WorkspaceParams, borders
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    any_perpendicular,
    closest_on_segment,
    closest_points,
    cross,
    dot,
    norm,
    shaft_point_velocity,
    sub,
    unit,
    xyz,
)
from systems.common.projection import greatest_rate, nearest_velocity
from systems.common.signals import (
    CAMERA_EXAMPLE,
    GUIDE_EXAMPLE,
    OBSTACLE_EXAMPLE,
    ROBOT_TOOL_EXAMPLE,
    TARGET_EXAMPLE,
    VIEW_CONE_EXAMPLE,
    usable,
)
from systems.common.step_block import StepBlock

_PARALLEL = 0.2
"""Sine of the angle below which a tip's own distance is constrained as well."""
_OUTWARDS = 0.05
"""Share of insertion in A above which retracting would bring R nearer to the tool."""
_MISSED = 1e-3
"""A row is missed by more than the solver's own error, m/s."""
_ROWS = 14
_FREE = np.array([1.0, 0.0])
TOOLS = 3
"""Most obstacle tools: O, S, endoscope."""


@dataclass
class ClearanceConstraintParams:
    """Parameters of `ClearanceConstraint`.

    Attributes:
        active: If not, the velocity passes unchanged, and the status is still given.
        period: Of the update, s.
        max_speed: v_max that evasion may use, m/s.
        turning_speed: omega_max of the shaft, rad/s.
        rate: gamma, 1/s; at most a_max / (v_max + V_O).
        obstacle_speed: V_O to be reckoned with, m/s: within D_safe + V_O / gamma a tool
            counts as near.
        dodge: Whether to dodge.
    """

    active: bool = True
    period: float = 1.0 / 60.0
    max_speed: float = 0.1
    turning_speed: float = 1.0
    rate: float = 4.0
    obstacle_speed: float = 0.06
    dodge: bool = True

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        for name, value in vars(self).items():
            if isinstance(value, float) and not 0.0 <= value < inf:
                raise ValueError(
                    f"clearance_constraint: {name}={value} must be finite and >= 0"
                )
        for name in ("period", "max_speed", "turning_speed", "rate"):
            if not getattr(self, name) > 0.0:
                raise ValueError(
                    f"clearance_constraint: {name}={getattr(self, name)} must be > 0"
                )
        if self.rate * self.period > 0.5:
            raise ValueError(
                f"clearance_constraint: rate={self.rate} /s is too fast for "
                f"period={self.period} s, expected at most {0.5 / self.period:.4g} /s"
            )


def constants(params: ClearanceConstraintParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    params.check()
    return packed(params)


@compiled
def distance_rate(
    g: Vector, p: Vector, tool: np.ndarray
) -> tuple[float, float, Vector, float, bool]:
    """How the distance of the axes to a tool changes: d rho/dt = A . v - c.

    A closest point at a fulcrum is no material point: there its tool does not count.

    Args:
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        tool: A row of obstacle tools.

    Returns:
        rho in m, s, A, c in m/s, and whether the shafts are nearly parallel.
    """
    a, p_o = xyz(tool, FULCRUM), xyz(tool, TIP)
    s, fraction, rho, m_r, m_o = closest_points(g, p, a, p_o)
    u, o = unit(sub(p, g)), unit(sub(p_o, a))
    across = cross(u, o)
    n = unit(sub(m_r, m_o), unit(across, any_perpendicular(u)))
    row = (0.0, 0.0, 0.0)
    if s > 0.0:
        out = dot(n, u)
        row = (
            s * n[0] + (1.0 - s) * out * u[0],
            s * n[1] + (1.0 - s) * out * u[1],
            s * n[2] + (1.0 - s) * out * u[2],
        )
    closing = 0.0
    if fraction > 0.0:
        closing = dot(n, shaft_point_velocity(fraction, o, xyz(tool, VELOCITY)))
    return rho, s, row, closing, norm(across) < _PARALLEL


@compiled
def _ends(g: Vector, p: Vector, tool: np.ndarray) -> np.ndarray:
    """Both tips' distances for nearly parallel shafts, (2, 5): A, c, rho."""
    a, p_o = xyz(tool, FULCRUM), xyz(tool, TIP)
    v_o = xyz(tool, VELOCITY)
    u, o = unit(sub(p, g)), unit(sub(p_o, a))
    ends = np.zeros((2, 5))
    # R's tip and O's shaft, O's tip and R's shaft.
    fraction, rho = closest_on_segment(p, a, p_o)
    n = unit(sub(p, along(a, fraction, sub(p_o, a))), any_perpendicular(u))
    closing = dot(n, shaft_point_velocity(fraction, o, v_o)) if fraction > 0.0 else 0.0
    ends[0, 0], ends[0, 1], ends[0, 2] = n[0], n[1], n[2]
    ends[0, 3], ends[0, 4] = closing, rho
    s, rho = closest_on_segment(p_o, g, p)
    n = unit(sub(along(g, s, sub(p, g)), p_o), any_perpendicular(u))
    out = dot(n, u)
    if s > 0.0:
        for i in range(3):
            ends[1, i] = s * n[i] + (1.0 - s) * out * u[i]
    ends[1, 3], ends[1, 4] = dot(n, v_o), rho
    return ends


@compiled
def must_dodge(
    params: Any,
    is_dodging: bool,
    q: float,
    rho: float,
    safe: float,
    s: float,
    outwards: float,
    closing: float,
    evasion: float,
) -> bool:
    """Whether R retracts from a tool that sweeps the inside of its shaft."""
    if outwards > _OUTWARDS or closing <= (0.4 if is_dodging else 0.6) * evasion:
        return False
    left = max(0.0, rho - safe) / max(closing, 1e-6)
    needed = (q - (s * q - safe)) / params.max_speed
    return left < 1.5 * needed + 0.3


@compiled
def constrain(
    params: Any,
    workspace: Any,
    view_cone: Numbers,
    g: Vector,
    p: Vector,
    wanted: Vector,
    tools: np.ndarray,
    dodging: Numbers,
) -> tuple[Vector, np.ndarray, np.ndarray]:
    """One step: the tip's velocity nearest to the wanted one that is safe.

    Args:
        params: A record of `constants`.
        workspace: A record of `workspace.constants`.
        view_cone: Apex, axis, half angle (7).
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        wanted: The tip's wanted velocity, m/s.
        tools: Obstacle tools (n, 11), n <= 3.
        dodging: Whether R dodges each of them (3), 1 or 0.

    Returns:
        The tip's velocity in m/s, whether R dodges each tool (3), and the status (6),
        see `ClearanceConstraint`.
    """
    shaft = sub(p, g)
    q, u = norm(shaft), unit(shaft)
    turning = q * params.turning_speed
    rows, bounds = np.zeros((_ROWS, 3)), np.full(_ROWS, -1e9)
    dodges = np.zeros(TOOLS)
    status = np.array([1e9, 0.0, 1.0, 0.0, 0.0, 0.0])
    near = params.obstacle_speed / params.rate
    inwards, room = borders(workspace, view_cone, g, p)
    # A tip that is outside comes back no faster than it may go at all.
    least = np.minimum(-params.rate * room, 0.25 * params.max_speed)
    last = 0
    for i in range(len(tools)):
        rho, s, row, closing, is_parallel = distance_rate(g, p, tools[i])
        safe = tools[i, SAFE]
        evasion = greatest_rate(row, u, params.max_speed, turning)
        if rho - safe < near:
            far = along((0.0, 0.0, 0.0), 100.0 * params.max_speed, row)
            best, _ = nearest_velocity(
                far, inwards, least, u, params.max_speed, turning
            )
            evasion = max(0.0, min(evasion, dot(row, best)))
        if rho - safe < status[0]:
            status[0] = rho - safe
        if rho - safe < near:
            status[1] = 1.0
            if closing > evasion:
                status[2] = 0.0
        if params.dodge and must_dodge(
            params, dodging[i] > 0.5, q, rho, safe, s, dot(row, u), closing, evasion
        ):
            dodges[i] = status[3] = 1.0
        rows[last, 0], rows[last, 1], rows[last, 2] = row
        # No more is asked for than can be done: as fast away as possible.
        bounds[last] = min(closing - params.rate * (rho - safe), 0.9999 * evasion)
        last += 1
        if is_parallel:
            ends = _ends(g, p, tools[i])
            for k in range(2):
                end = ends[k]
                for axis in range(3):
                    rows[last, axis] = end[axis]
                evasion = greatest_rate(xyz(end, 0), u, params.max_speed, turning)
                bound = end[3] - params.rate * (end[4] - safe)
                bounds[last] = min(bound, 0.9999 * evasion)
                last += 1
    if status[3] > 0.5:
        wanted = (
            -params.max_speed * u[0],
            -params.max_speed * u[1],
            -params.max_speed * u[2],
        )
    if params.active:
        for i in range(5):
            for axis in range(3):
                rows[last, axis] = inwards[i, axis]
            bounds[last] = least[i]
            last += 1
        v, missed = nearest_velocity(
            wanted, rows[:last], bounds[:last], u, params.max_speed, turning
        )
        status[4] = norm(sub(v, wanted))
        status[5] = missed
        # Several tools may ask for what cannot be had together.
        if missed > _MISSED:
            status[2] = 0.0
        wanted = v
    return wanted, dodges, status


@compiled
def _step(
    record: np.ndarray,
    margins: np.ndarray,
    workspace: np.ndarray,
    state: np.ndarray,
    v_R: np.ndarray,
    guide: np.ndarray,
    robot_tool: np.ndarray,
    obstacle: np.ndarray,
    target: np.ndarray,
    camera: np.ndarray,
    view_cone: np.ndarray,
    permission: np.ndarray,
) -> np.ndarray:
    """The next state (3), the guide point's velocity (3) and the status (6)."""
    params = record[0]
    v = xyz(v_R, 0)
    known = usable(obstacle) and usable(target)
    numbers = all_finite(v_R) and all_finite(guide) and all_finite(robot_tool)
    if not (known and numbers and all_finite(view_cone)):
        none = (0.0, 0.0, 0.0)
        return np.array(none + v + (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    g, p, s = xyz(robot_tool, 0), xyz(robot_tool, 3), guide[7]
    tools = obstacle_tools(margins[0], g, obstacle, target, camera)
    share = max(0.0, min(1.0, permission[0])) / s
    wanted = (v[0] * share, v[1] * share, v[2] * share)
    v, dodges, status = constrain(
        params, workspace[0], view_cone, g, p, wanted, tools, state
    )
    result = np.empty(12)
    result[0:3] = dodges
    for i in range(3):
        result[3 + i] = s * v[i]
    result[6:] = status
    return result


class ClearanceConstraint(StepBlock):
    """Holds a hard clearance to the surgeon's tools under any planner.

    After the fuzzy sum, before the tool's navigation; see the module. While an estimate
    is not usable or an input is not finite the velocity passes as it is: then the
    arbiter slows R down and the navigation stops it.

    Port ``v_R`` accepts the wanted velocity of the guide point (3), m/s, in W.
    Port ``guide`` accepts the guide signal (12), of which s is used.
    Port ``robot_tool`` accepts the robot's instrument: fulcrum G_R and tip P_R
    (6), m, in W.
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``target`` accepts the estimate (17) of the target tool S.
    Port ``camera`` accepts the estimate (17) of the endoscope.
    Port ``view_cone`` accepts apex p_WC, axis, half angle (7).
    Port ``permission`` accepts the share of its speed that the passive wrist allows the
    task, and a code that is not used (2); 1 if not connected. Evasion is not slowed.
    Port ``v_safe`` emits the velocity of the guide point (3), m/s, in W.
    Port ``status`` emits (6): the least rho - D_safe in m, 1 while a tool is near, 1
    while the evasion condition holds for all that are near, 1 while R dodges, by how
    much the tip's velocity was changed in m/s, and by how much a row is missed in m/s.

    The discrete state is whether R dodges each tool (3).
    """

    def __init__(
        self,
        params: ClearanceConstraintParams | None = None,
        margins: Margins | None = None,
        workspace: WorkspaceParams | None = None,
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            margins: Distances to the tools; the defaults if None.
            workspace: Limits of R's tip; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        params = params or ClearanceConstraintParams()
        step = partial(
            _step,
            constants(params),
            tools_around.constants(margins or Margins()),
            limits.constants(workspace or WorkspaceParams()),
        )
        self.declare_step(
            step,
            {
                "v_R": [0.05, 0.0, 0.0],
                "guide": GUIDE_EXAMPLE,
                "robot_tool": ROBOT_TOOL_EXAMPLE,
                "obstacle": OBSTACLE_EXAMPLE,
                "target": TARGET_EXAMPLE,
                "camera": CAMERA_EXAMPLE,
                "view_cone": VIEW_CONE_EXAMPLE,
                "permission": _FREE.tolist(),
            },
            [0.0] * TOOLS,
            {"v_safe": 3, "status": 6},
            params.period,
            timed=False,
            defaults={"permission": _FREE},
        )
