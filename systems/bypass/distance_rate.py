"""How the distance of R to what it must keep clear of changes: d rho/dt = A . v - c.

See `safe_velocity` for the equation. It holds for the shafts' closest points,
inside and above the wall, for the ends of shafts that are nearly parallel, and for
organs (`organ_rows`).
"""

from typing import Any, NamedTuple

from systems.bypass.shadow_body import ObstacleTool
from systems.common.compiled import compiled
from systems.common.geometry import (
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
)
from systems.common.signal import Vector
from systems.common.signals import UNHINDERED, Leeway

_PARALLEL = 0.2
"""Sine of the angle below which a tip's own distance is constrained as well."""


class DistanceRate(NamedTuple):
    """How a distance of the axes changes: d rho/dt = A . v - c.

    Attributes:
        rho: The distance, m.
        s: Proportion of R's inserted length at which it is.
        A: What the velocity of R's tip does.
        c: What the tool itself does, m/s.
        n: Unit vector from the tool to R.
        l_over_L: Proportion of the tool's inserted length at which it is.
    """

    rho: float
    s: float
    A: Vector
    c: float
    n: Vector
    l_over_L: float


@compiled
def drifting(rate: DistanceRate, v_G: Vector, v_GO: Vector) -> DistanceRate:
    """The same for trocars that move: R's at v_G, the tool's at v_GO, m/s."""
    own = (1.0 - rate.s) * dot(rate.n, v_G)
    closing = rate.c + (1.0 - rate.l_over_L) * dot(rate.n, v_GO) - own
    return DistanceRate(rate.rho, rate.s, rate.A, closing, rate.n, rate.l_over_L)


@compiled
def leverage(s: float, n: Vector, u: Vector) -> Vector:
    """A for the proportion s of R along u; a fulcrum is no material point."""
    if s == 0.0:
        return 0.0, 0.0, 0.0
    return shaft_point_velocity(s, u, n)


@compiled
def distance_rate(g: Vector, p: Vector, tool: ObstacleTool) -> DistanceRate:
    """How the distance to a tool changes for R from its fulcrum g to its tip p, m.

    A closest point at a fulcrum is no material point: there its tool does not count.
    """
    near = closest_points(g, p, tool.fulcrum, tool.tip)
    u, o = unit(sub(p, g)), unit(sub(tool.tip, tool.fulcrum))
    n = unit(sub(near.p_A, near.p_B), unit(cross(u, o), any_perpendicular(u)))
    closing = 0.0
    if near.t > 0.0:
        closing = dot(n, shaft_point_velocity(near.t, o, tool.v))
    return DistanceRate(
        near.distance, near.s, leverage(near.s, n, u), closing, n, near.t
    )


@compiled
def outer_rate(
    g: Vector, p: Vector, tool: ObstacleTool, outside: float
) -> DistanceRate:
    """The same above the wall, for `outside` m of both shafts: s is negative there."""
    shaft, other = sub(p, g), sub(tool.tip, tool.fulcrum)
    u, o = unit(shaft), unit(other)
    ends = along(g, -outside, u), along(tool.fulcrum, -outside, o)
    near = closest_points(g, ends[0], tool.fulcrum, ends[1])
    n = unit(sub(near.p_A, near.p_B), unit(cross(u, o), any_perpendicular(u)))
    s, l_over_L = -near.s * outside / norm(shaft), -near.t * outside / norm(other)
    closing = 0.0
    if near.t > 0.0:
        closing = dot(n, shaft_point_velocity(l_over_L, o, tool.v))
    return DistanceRate(near.distance, s, leverage(s, n, u), closing, n, l_over_L)


@compiled
def are_parallel(g: Vector, p: Vector, tool: ObstacleTool) -> bool:
    """Whether R and a tool are nearly parallel: the closest points jump there."""
    u, o = unit(sub(p, g)), unit(sub(tool.tip, tool.fulcrum))
    return norm(cross(u, o)) < _PARALLEL


@compiled
def tip_rates(
    g: Vector, p: Vector, tool: ObstacleTool
) -> tuple[DistanceRate, DistanceRate]:
    """The same for R's tip and the tool's shaft, and for its tip and R's shaft."""
    a, p_o = tool.fulcrum, tool.tip
    u, o = unit(sub(p, g)), unit(sub(p_o, a))
    aside = any_perpendicular(u)
    t, rho = closest_on_segment(p, a, p_o)
    n = unit(sub(p, along(a, t, sub(p_o, a))), aside)
    closing = dot(n, shaft_point_velocity(t, o, tool.v)) if t > 0.0 else 0.0
    own = DistanceRate(rho, 1.0, n, closing, n, t)
    s, rho = closest_on_segment(p_o, g, p)
    n = unit(sub(along(g, s, sub(p, g)), p_o), aside)
    return own, DistanceRate(rho, s, leverage(s, n, u), dot(n, tool.v), n, 1.0)


@compiled
def leeway(params: Any, rate: DistanceRate, safe: float, e: Vector) -> Leeway:
    """How fast R's fulcrum may move along e and against it, the tip at rest.

    A fulcrum at w e adds (1 - s) w n . e to d rho/dt, which is held as ever.
    """
    closing = -(1.0 - rate.s) * dot(rate.n, e)
    most = max(0.0, params.rate * (rate.rho - safe) - rate.c)
    fastest = min(UNHINDERED.forth, most / max(abs(closing), 1e-9))
    if closing > 0.0:
        return Leeway(fastest, UNHINDERED.back)
    return Leeway(UNHINDERED.forth, fastest)


@compiled
def less(a: Leeway, b: Leeway) -> Leeway:
    """What both leave."""
    return Leeway(min(a.forth, b.forth), min(a.back, b.back))


@compiled
def least_rate(params: Any, rate: DistanceRate, safe: float, evasion: float) -> float:
    """The bound of A . v, m/s: no more than can be done, as fast away as possible."""
    return min(rate.c - params.rate * (rate.rho - safe), 0.9999 * evasion)
