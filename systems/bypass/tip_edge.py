"""The tip edge: past the obstacle tool's tip, where R goes round the end of O.

On the sphere of directions about G the tip of O is a cap of half angle alpha = asin(D /
r_P), and the shadow of O's shaft leads from it to the wall. The taut path of R's
direction goes round the cap on the free side. The cone of all rays over that path
unrolls into the plane; there the tip's shortest way is straight:

    Gamma^2 = q_p^2 + q_g^2 - 2 q_p q_g cos(Theta),

Theta being the length of the path on the sphere. Insertion and turning share the tip's
speed exactly as on the shortest way.
"""

from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt, tan
from typing import Any

from systems.bypass.top_edge import Route, no_route
from systems.bypass.workspace import line_inside
from systems.common.compiled import compiled
from systems.common.geometry import (
    across,
    along,
    any_perpendicular,
    cross,
    dot,
    norm,
    over,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.signal import Vector
from systems.common.signals import ViewCone


@compiled
def arccos(x: float) -> float:
    """The arc cosine, for numbers that rounding may have put outside [-1, 1]."""
    return acos(max(-1.0, min(1.0, x)))


@compiled
def fan(q0: float, q1: float, angle: float) -> float:
    """Straight distance in the plane of two points q0 and q1 from its origin."""
    if angle >= pi:
        return q0 + q1
    return sqrt(max(0.0, q0 * q0 + q1 * q1 - 2.0 * q0 * q1 * cos(angle)))


@compiled
def tip_edge(
    g: Vector,
    p: Vector,
    goal: Vector,
    a: Vector,
    p_o: Vector,
    distance: float,
    workspace: Any,
    view_cone: ViewCone,
) -> Route:
    """The shortest way of R's tip from p to `goal` round O's tip.

    Args:
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: Where it is to go, m.
        a: Fulcrum G_O, m.
        p_o: Tip of O, m.
        distance: D of the axes that the way keeps, m.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
    """
    to_tip = sub(p_o, g)
    r = norm(to_tip)
    if r <= distance:
        return no_route(p)
    c = unit(to_tip)
    alpha = asin(distance / r)
    away = unit(scaled(-1.0, across(sub(a, g), c)), any_perpendicular(c))
    side = cross(c, away)
    m, k = sub(p, g), sub(goal, g)
    q_p, q_f = norm(m), norm(k)
    u_p, u_f = unit(m), unit(k)
    theta_p, theta_f = arccos(dot(u_p, c)), arccos(dot(u_f, c))
    psi_p = atan2(dot(u_p, side), dot(u_p, away))
    psi_f = atan2(dot(u_f, side), dot(u_f, away))
    turn = psi_f - psi_p  # never through pi: there the shaft's shadow is
    sigma = 1.0 if turn >= 0.0 else -1.0
    beta_p = arccos(tan(alpha) / tan(theta_p)) if theta_p > alpha else 0.0
    beta_f = arccos(tan(alpha) / tan(theta_f)) if theta_f > alpha else 0.0
    arc = abs(turn) - beta_p - beta_f
    sine = max(1e-9, sin(theta_p))
    reach_p = arccos(cos(theta_p) / cos(alpha)) if theta_p > alpha else 0.0
    reach_f = arccos(cos(theta_f) / cos(alpha)) if theta_f > alpha else 0.0
    if arc > 0.0:
        path = reach_p + sin(alpha) * arc + reach_f
        inwards = unit(across(c, u_p), away)
        around = over(cross(c, u_p), sine)
        if theta_p >= alpha:
            sideways = min(1.0, sin(alpha) / sine)
            toward = sqrt(1.0 - sideways * sideways)
        else:
            out = min(1.0, 4.0 * (alpha - theta_p) / alpha)
            size = hypot(1.0, out)
            sideways, toward = 1.0 / size, -out / size
        turning = along(scaled(toward, inwards), sigma * sideways, around)
    else:
        path = arccos(dot(u_p, u_f))
        turning = unit(across(u_f, u_p))
    total = fan(q_p, q_f, path)
    # The leg that the tip is on now: to the goal, or to a point at the edge.
    leg, q_leg, path_leg = total, q_f, path
    edge = goal
    if psi_p * psi_f < 0.0:
        first = reach_p + sin(alpha) * (abs(psi_p) - beta_p)
        first = max(1e-6, min(path - 1e-6, first))
        u_x = plus(scaled(cos(alpha), c), scaled(sin(alpha), away))
        straight = q_p * sin(first) + q_f * sin(path - first)
        q_x = 0.0
        if path < pi and straight > 0.0:
            q_x = q_p * q_f * sin(path) / straight
        low, high = line_inside(
            workspace, view_cone, g, g, u_x, workspace.min_insertion, 1.0
        )
        if low > high:
            return no_route(p)
        if not low <= q_x <= high:
            q_x = max(low, min(high, q_x))
            leg, q_leg, path_leg = fan(q_p, q_x, first), q_x, first
            total = leg + fan(q_x, q_f, path - first)
        edge = along(g, q_x, u_x)
    leg = max(leg, 1e-9)
    outwards = (q_leg * cos(path_leg) - q_p) / leg
    aside = q_leg * sin(path_leg) / leg
    if path_leg >= pi:
        outwards, aside = -1.0, 0.0
    direction = plus(scaled(outwards, u_p), scaled(aside, turning))
    return Route(True, total, unit(direction), edge)
