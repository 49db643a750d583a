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

import numpy as np

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import (
    along,
    closest_points,
    dot,
    norm,
    segment_triangle_distance,
    sub,
    unit,
    xyz,
)

FAR = 1.0
"""A depth beyond any tool's reach, m."""


@compiled
def sphere_entry(g: Numbers, u: Numbers, center: Numbers, radius: float) -> float:
    """Depth at which the ray from g along u enters a sphere, m; FAR if it does not."""
    m = sub(g, center)
    b = dot(m, u)
    c = dot(m, m) - radius * radius
    discriminant = b * b - c
    if discriminant < 0.0 or b > 0.0:
        return FAR if c > 0.0 else 0.0
    return max(0.0, -b - sqrt(discriminant))


@compiled
def free_depth(
    g: Numbers, u: Numbers, a: Numbers, p: Numbers, distance: float
) -> float:
    """First depth at which the ray from g comes within `distance` of the segment ap.

    Args:
        g: Fulcrum of R, m.
        u: Unit vector along R.
        a: Fulcrum of the obstacle tool, m.
        p: Its tip, m.
        distance: D, m.

    Returns:
        q_c, m: R is free at all depths below it. FAR where the ray never comes near.
    """
    depth = min(sphere_entry(g, u, a, distance), sphere_entry(g, u, p, distance))
    d = sub(p, a)
    length = norm(d)
    o = unit(d)
    # The cylinder between the two spheres: everything across O's axis.
    m = sub(g, a)
    mo, uo = dot(m, o), dot(u, o)
    m = along(m, -mo, o)
    across = along(u, -uo, o)
    k = dot(across, across)
    b = dot(m, across)
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


# A tool in an array of obstacle tools: what stands at which column.
TIP = 0
VELOCITY = 3
FULCRUM = 6
SAFE = 9
PLAN = 10
COLUMNS = 11


@compiled
def pose_distance(tool: np.ndarray, g: Numbers, p: Numbers) -> float:
    """Distance of the axes of R (g to p) and an obstacle tool, m.

    Args:
        tool: A row (11) of obstacle tools: tip, its velocity, fulcrum, then the
            distances of the axes that are held at least and planned with, m.
        g: Fulcrum of R, m.
        p: Tip of R, m.
    """
    return closest_points(g, p, xyz(tool, FULCRUM), xyz(tool, TIP))[2]


@compiled
def way_distance(tool: np.ndarray, g: Numbers, p: Numbers, goal: Numbers) -> float:
    """Least distance of the axes while R's tip goes straight from p to `goal`, m."""
    return segment_triangle_distance(xyz(tool, FULCRUM), xyz(tool, TIP), g, p, goal)
