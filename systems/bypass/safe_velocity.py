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

from typing import Any

import numpy as np

from plants.organs.distance import Organs
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
from systems.bypass.organ_rows import organ_rows
from systems.bypass.shadow_body import read_tool
from systems.bypass.workspace import VIEW, borders
from systems.common.compiled import compiled
from systems.common.geometry import dot, norm, row_of, scaled, set_row, sub, unit
from systems.common.projection import greatest_rate, most_missed, nearest_velocity
from systems.common.reach_limits import fastest_sideways
from systems.common.signal import Vector
from systems.common.signals import UNHINDERED, ClearanceStatus, ViewCone
from systems.passive_wrist.wall_model import lateral_basis

_MISSED = 1e-3
"""A row is missed by more than the solver's own error, m/s."""


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
    withdraws: float = 0.0,
) -> tuple[Vector, np.ndarray, ClearanceStatus]:
    """One step: the tip's velocity nearest to the wanted one that is safe.

    Args:
        params: A record of `clearance_constraint.constants`.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        wanted: The tip's wanted velocity, m/s.
        tools: Rows of `ObstacleTool`.
        dodging: Whether R dodges each of them, 1 or 0; as many or more.
        drift: Velocities of R's trocar and of theirs, rows, m/s; one more.
        organs: What else to keep clear of; None is compiled away.
        withdraws: How fast R withdraws anyway, m/s.

    Returns:
        The tip's velocity in m/s, whether R dodges each tool, and the status.
    """
    shaft = sub(p, g)
    q, u = norm(shaft), unit(shaft)
    turning = fastest_sideways(workspace, q, params.turning_speed)
    dodges = np.zeros(len(dodging))
    least, is_near, holds, change, missed = 1e9, 0.0, 1.0, 0.0, 0.0
    dodge, out = (1.0 if withdraws > 0.0 else 0.0), withdraws
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
            out = params.max_speed
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
        wanted = scaled(-out, u)
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
