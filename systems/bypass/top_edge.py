"""The top edge: over the obstacle tool's shaft, on the side of R's own fulcrum.

The tip's shortest way over the edge is taut on the cylinder of radius D about O's axis:
a helix, with straight lines to and from it. Gamma is its length. Seen along the axis it
is the involute-helicoid: a tangent to a circle, an arc, a tangent. Retracting, turning
and inserting happen at once; no rule is needed for any of them.
"""

from math import acos, atan2, cos, hypot, isfinite, sqrt
from typing import Any, NamedTuple

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

LEAST_ARM = 0.01
"""The edge begins this far inside O's fulcrum: nearer there is wall, m."""


class Route(NamedTuple):
    """A way over an edge: its length in m, the tip's direction, a point of the edge."""

    is_there: bool
    length: float
    direction: Vector
    edge: Vector


@compiled
def no_route(p: Vector) -> Route:
    """The answer where there is no way."""
    return Route(False, 1e9, (0.0, 0.0, 0.0), p)


@compiled
def nearest_room(t: float, low: float, high: float, center: float, gap: float) -> float:
    """The number nearest to t in [low, high] but not within `gap` of `center`.

    NaN if there is none.
    """
    t = max(low, min(high, t))
    if low > high:
        return float("nan")
    if abs(t - center) >= gap:
        return t
    below, above = center - gap, center + gap
    down, up = t - below, above - t
    if below < low:
        down = 1e9
    if above > high:
        up = 1e9
    if down > 1e8 and up > 1e8:
        return float("nan")
    return below if down < up else above


@compiled
def top_edge(
    g: Vector,
    p: Vector,
    goal: Vector,
    a: Vector,
    p_o: Vector,
    distance: float,
    workspace: Any,
    view_cone: ViewCone,
) -> Route:
    """The shortest way of R's tip from p to `goal` over O's shaft.

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
    shaft, w = sub(p_o, a), sub(g, a)
    length, o = norm(shaft), unit(shaft)
    t_g, radial = dot(w, o), across(w, o)
    d_g = norm(radial)
    e1 = unit(radial, any_perpendicular(o))
    e2 = cross(o, e1)
    # Cylinder coordinates of tip and goal; phi = 0 towards G.
    m, k = sub(p, a), sub(goal, a)
    t_p, x_p, y_p = dot(m, o), dot(m, e1), dot(m, e2)
    t_f, x_f, y_f = dot(k, o), dot(k, e1), dot(k, e2)
    d_p, d_f = hypot(x_p, y_p), hypot(x_f, y_f)
    phi_p, phi_f = atan2(y_p, x_p), atan2(y_f, x_f)
    turn = phi_f - phi_p  # never through pi: there the shadow is
    sigma = 1.0 if turn >= 0.0 else -1.0
    beta_p = acos(min(1.0, distance / max(d_p, 1e-9)))
    beta_f = acos(min(1.0, distance / max(d_f, 1e-9)))
    arc = abs(turn) - beta_p - beta_f
    reach_p = sqrt(max(0.0, d_p * d_p - distance * distance))
    reach_f = sqrt(max(0.0, d_f * d_f - distance * distance))
    if arc > 0.0:
        way = reach_p + distance * arc + reach_f
        if d_p >= distance:
            inwards = -sqrt(max(0.0, 1.0 - (distance / d_p) ** 2))
            sideways = sigma * distance / d_p
        else:
            out = min(1.0, 4.0 * (distance - d_p) / distance)
            size = hypot(1.0, out)
            inwards, sideways = out / size, sigma / size
        rx, ry = x_p / max(d_p, 1e-9), y_p / max(d_p, 1e-9)
        ex, ey = inwards * rx - sideways * ry, inwards * ry + sideways * rx
    else:
        way = sqrt(max(1e-18, d_p * d_p + d_f * d_f - 2.0 * d_p * d_f * cos(turn)))
        ex, ey = (x_f - x_p) / way, (y_f - y_p) / way
    way = max(way, 1e-9)
    rise = t_f - t_p
    total = hypot(way, rise)
    slope = rise / way
    edge = along(a, distance, e1)
    if phi_p * phi_f < 0.0:
        # Where the way crosses the plane of G and O: on the tool, with room above it.
        first = reach_p + distance * (abs(phi_p) - beta_p)
        first = max(1e-6, min(way - 1e-6, first))
        t_x = t_p + slope * first
        low, high = line_inside(
            workspace, view_cone, g, edge, o, min(LEAST_ARM, 0.5 * length), length
        )
        room = workspace.min_insertion + distance
        gap = sqrt(max(0.0, room * room - d_g * d_g))
        t_edge = nearest_room(t_x, low, high, t_g, gap)
        if not isfinite(t_edge):
            return no_route(p)
        if t_edge != t_x:
            slope = (t_edge - t_p) / first
            total = hypot(first, t_edge - t_p) + hypot(way - first, t_f - t_edge)
        edge = along(edge, t_edge, o)
    else:
        edge = goal
    round_o = plus(scaled(ex, e1), scaled(ey, e2))
    direction = over(along(round_o, slope, o), hypot(1.0, slope))
    return Route(True, total, direction, edge)
