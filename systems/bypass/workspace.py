"""Where the tip of R may be: insertion, tilt, floor, view cone.

Each limit is a convex set, so that the part of a line inside them all is an interval.
"""

from dataclasses import dataclass
from math import cos, pi, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    dot,
    norm,
    over,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import check, parameter
from systems.common.reach_limits import ReachLimits
from systems.common.signal import Vector
from systems.common.signals import ViewCone

_DOWN = (0.0, 0.0, -1.0)
BORDERS = 5
"""How many there are."""
VIEW = 4
"""Place of the view cone's, the last: it is the first to give way."""


@dataclass
class WorkspaceParams:
    """What the planner knows beyond the `ReachLimits` of the navigation behind it."""

    floor: float = parameter(
        -0.2, "height of what must not be touched below", "m", least=-0.5, most=0.0
    )


def constants(
    limits: ReachLimits | None = None, workspace: WorkspaceParams | None = None
) -> np.ndarray:
    """The limits of R's tip as the compiled functions take them; defaults if None."""
    limits, workspace = limits or ReachLimits(), workspace or WorkspaceParams()
    check(limits)
    check(workspace)
    return packed(
        workspace,
        min_insertion=limits.min_insertion,
        max_insertion=limits.max_insertion,
        max_tilt=limits.max_tilt,
        cone_margin=limits.cone_margin,
        wrist_speed=limits.wrist_speed,
        wrist_acceleration=limits.wrist_acceleration,
        shaft_length=limits.shaft_length,
    )


@compiled
def tilt_cone(workspace: Any, g: Vector) -> ViewCone:
    """The cone under the fulcrum g within the greatest tilt."""
    return ViewCone(g, _DOWN, workspace.max_tilt)


@compiled
def narrowed(workspace: Any, view_cone: ViewCone) -> ViewCone:
    """The view cone less its margin, where it does not hold everything anyway."""
    is_whole = view_cone.half >= 0.5 * pi
    half = pi if is_whole else view_cone.half - workspace.cone_margin
    return ViewCone(view_cone.apex, view_cone.u, half)


@compiled
def line_in_cone(x: Vector, d: Vector, cone: ViewCone) -> tuple[float, float]:
    """The interval of t for which x + t d lies in a cone; (1, 0) if there is none.

    A cone of half angle pi/2 or more holds everything.
    """
    if cone.half >= 0.5 * pi:
        return -1e9, 1e9
    m = sub(x, cone.apex)
    c2 = cos(cone.half) ** 2
    ma, da = dot(m, cone.u), dot(d, cone.u)
    k = da * da - c2 * dot(d, d)
    b = ma * da - c2 * dot(m, d)
    c = ma * ma - c2 * dot(m, m)
    discriminant = b * b - k * c
    if abs(k) < 1e-15 or (k < 0.0 and discriminant < 0.0):
        return 1.0, 0.0
    # Along a line steeper than the cone it is negative by rounding only.
    root = sqrt(max(0.0, discriminant))
    first, second = (-b - root) / k, (-b + root) / k
    low, high = min(first, second), max(first, second)
    if k < 0.0:  # between the roots, on the side the axis points to
        if ma + 0.5 * (low + high) * da <= 0.0:
            return 1.0, 0.0
        return low, high
    return (high, 1e9) if da > 0.0 else (-1e9, low)


@compiled
def line_inside(
    workspace: Any,
    view_cone: ViewCone,
    g: Vector,
    x: Vector,
    d: Vector,
    low: float,
    high: float,
) -> tuple[float, float]:
    """The part of [low, high] for which x + t d is a place for R's tip.

    Least insertion is not looked at: the places above it are not convex.

    Args:
        workspace: A record of `constants`.
        view_cone: What the endoscope sees.
        g: Fulcrum of R, m.
        x: A point of the line, m.
        d: Its direction, a unit vector.
        low: Least t, m.
        high: Greatest t, m.

    Returns:
        (low, high), m; low > high if there is none.
    """
    a, b = line_in_cone(x, d, tilt_cone(workspace, g))
    low, high = max(low, a), min(high, b)
    a, b = line_in_cone(x, d, narrowed(workspace, view_cone))
    low, high = max(low, a), min(high, b)
    m = sub(x, g)
    middle = -dot(m, d)
    reach = workspace.max_insertion**2 - dot(m, m) + middle * middle
    if reach < 0.0:
        return 1.0, 0.0
    low, high = max(low, middle - sqrt(reach)), min(high, middle + sqrt(reach))
    height = x[2] - workspace.floor
    if abs(d[2]) < 1e-12:
        return (low, high) if height >= 0.0 else (1.0, 0.0)
    if d[2] > 0.0:
        return max(low, -height / d[2]), high
    return low, min(high, -height / d[2])


@compiled
def is_inside(workspace: Any, view_cone: ViewCone, g: Vector, p: Vector) -> bool:
    """Whether p is a place for R's tip, all limits included."""
    shaft = sub(p, g)
    if norm(shaft) < workspace.min_insertion:
        return False
    low, high = line_inside(workspace, view_cone, g, p, unit(shaft, _DOWN), 0.0, 0.0)
    return low <= high


@compiled
def cone_border(cone: ViewCone, p: Vector) -> tuple[Vector, float]:
    """The inward normal of a cone's border and the room before it, m."""
    ray = sub(p, cone.apex)
    sideways = across(ray, cone.u)
    off = norm(sideways)
    if cone.half >= 0.5 * pi or off <= 1e-9:
        return (0.0, 0.0, 0.0), 1e9
    sine, cosine = sqrt(1.0 - cos(cone.half) ** 2), cos(cone.half)
    normal = sub(scaled(sine, cone.u), over(scaled(cosine, sideways), off))
    return normal, dot(ray, cone.u) * sine - off * cosine


@compiled
def borders(
    workspace: Any, view_cone: ViewCone, g: Vector, p: Vector
) -> tuple[np.ndarray, np.ndarray]:
    """The borders near the tip: inward normals (5, 3) and the room before each, m (5).

    Least and greatest insertion, tilt, floor, view cone. A border that does not exist
    has room without end.
    """
    shaft = sub(p, g)
    q, u = norm(shaft), unit(shaft, _DOWN)
    tilt, tilt_room = cone_border(tilt_cone(workspace, g), p)
    view, view_room = cone_border(narrowed(workspace, view_cone), p)
    normals = np.array((u, scaled(-1.0, u), tilt, scaled(-1.0, _DOWN), view))
    room = np.array(
        (
            q - workspace.min_insertion,
            workspace.max_insertion - q,
            tilt_room,
            p[2] - workspace.floor,
            view_room,
        )
    )
    return normals, room
