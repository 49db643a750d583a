"""The shadow body: an obstacle tool and all that lies behind it, seen from G_R.

Robot's tool R is a segment from its fulcrum G to its tip, the obstacle tool O a segment
too. R keeps the distance D of the axes from O if and only if its tip lies outside

    W_D = { x : dist([G, x], O) < D }.

So R is a point, its tip, among one obstacle, W_D. Two things follow:

- W_D = { G + k (c - G) : c in C, k >= 1 }, C being O grown by D. C is convex and G lies
  outside, hence W_D is convex: for two points G + k (c - G) and G + k' (c' - G) the
  middle is G + k'' (c'' - G) with k'' = (k + k')/2 >= 1 and c'' in C.
- Along each direction the free depths are an interval from 0 on. The free set is
  star-shaped about G: a shorter insertion is never nearer to O. This holds for any
  number of tools; the convexity does not (a union).

The straight motion of the tip from p to g sweeps the triangle G, p, g; see
`geometry.segment_triangle_distance`.
"""

from math import sqrt
from typing import Annotated, NamedTuple

from systems.common.compiled import compiled
from systems.common.geometry import (
    across,
    closest_points,
    dot,
    norm,
    segment_triangle_distance,
    sub,
    unit,
)
from systems.common.signal import Field, Vector, reader, row_writer

FAR = 1.0
"""A depth beyond any tool's reach, m."""


class ObstacleTool(NamedTuple):
    """A tool that R must not touch; several are the rows of an array (n, 11)."""

    tip: Annotated[Vector, Field("m", "p_WP", (0.0, 0.05, -0.1))]
    v: Annotated[Vector, Field("m/s", "v_WP", (0.0, -0.03, 0.0))]
    fulcrum: Annotated[Vector, Field("m", "p_WG", (0.0, 0.1, 0.0))]
    safe: Annotated[float, Field("m", "distance of the axes that is held", 0.007)]
    plan: Annotated[float, Field("m", "that ways are planned with", 0.0095)]


read_tool = reader(ObstacleTool)
write_tool = row_writer(ObstacleTool)


@compiled
def sphere_entry(g: Vector, u: Vector, center: Vector, radius: float) -> float:
    """Depth at which the ray from g along u enters a sphere, m; FAR if it does not."""
    m = sub(g, center)
    b = dot(m, u)
    c = dot(m, m) - radius * radius
    discriminant = b * b - c
    if discriminant < 0.0 or b > 0.0:
        return FAR if c > 0.0 else 0.0
    return max(0.0, -b - sqrt(discriminant))


@compiled
def free_depth(g: Vector, u: Vector, tool: ObstacleTool, distance: float) -> float:
    """First depth at which the ray from g comes within `distance` of a tool's axis.

    Args:
        g: Fulcrum of R, m.
        u: Unit vector along R.
        tool: The obstacle tool.
        distance: D, m.

    Returns:
        q_c, m: R is free at all depths below it. FAR where the ray never comes near.
    """
    a, p = tool.fulcrum, tool.tip
    depth = min(sphere_entry(g, u, a, distance), sphere_entry(g, u, p, distance))
    d = sub(p, a)
    length, o = norm(d), unit(d)
    # The cylinder between the two spheres: everything across O's axis.
    m = sub(g, a)
    mo, uo = dot(m, o), dot(u, o)
    m, side = across(m, o), across(u, o)
    k, b = dot(side, side), dot(m, side)
    c = dot(m, m) - distance * distance
    discriminant = b * b - k * c
    if k < 1e-12 or discriminant < 0.0:
        return depth
    entry = (-b - sqrt(discriminant)) / k
    if entry >= 0.0 and 0.0 <= mo + entry * uo <= length:
        depth = min(depth, entry)
    elif c <= 0.0 and 0.0 <= mo <= length:
        depth = 0.0
    return depth


@compiled
def pose_distance(tool: ObstacleTool, g: Vector, p: Vector) -> float:
    """Distance of the axes of R (g to p) and an obstacle tool, m."""
    return closest_points(g, p, tool.fulcrum, tool.tip).distance


@compiled
def way_distance(tool: ObstacleTool, g: Vector, p: Vector, goal: Vector) -> float:
    """Least distance of the axes while R's tip goes straight from p to `goal`, m."""
    return segment_triangle_distance(tool.fulcrum, tool.tip, g, p, goal)
