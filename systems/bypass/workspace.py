"""Where the tip of R may be: insertion, tilt, floor, view cone.

Each limit is a convex set, so that the part of a line inside them all is an interval.
"""

from dataclasses import dataclass
from math import cos, isfinite, pi, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import along, dot, norm, sub, unit, xyz

_DOWN = (0.0, 0.0, -1.0)


@dataclass
class WorkspaceParams:
    """Limits of the tip, W, SI units; the wall is above, z up.

    Attributes:
        min_insertion: q_min, least length of shaft inside the patient, m.
        max_insertion: Greatest length of shaft inside the patient, m.
        max_tilt: Greatest angle of the shaft to the vertical, rad.
        cone_margin: The tip stays this far inside the view cone's border, rad.
        floor: Height of what must not be touched below, m.
    """

    min_insertion: float = 0.03
    max_insertion: float = 0.2
    max_tilt: float = 0.7
    cone_margin: float = 0.02
    floor: float = -0.2

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        if not 0.0 < self.min_insertion < self.max_insertion:
            raise ValueError(
                f"workspace: min_insertion={self.min_insertion} m must be > 0 and less "
                f"than max_insertion={self.max_insertion} m"
            )
        if not 0.0 < self.max_tilt <= pi:
            raise ValueError(
                f"workspace: max_tilt={self.max_tilt} rad must be in (0, pi]; is it in "
                f"degrees?"
            )
        if not 0.0 <= self.cone_margin < 0.5 * pi:
            raise ValueError(
                f"workspace: cone_margin={self.cone_margin} rad must be in [0, pi/2)"
            )
        if not isfinite(self.floor):
            raise ValueError(f"workspace: floor={self.floor} m must be finite")


def constants(params: WorkspaceParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    params.check()
    return packed(params)


@compiled
def line_in_cone(
    x: Numbers, d: Numbers, apex: Numbers, axis: Numbers, half: float
) -> tuple[float, float]:
    """The interval of t for which x + t d lies in a cone; (1, 0) if there is none.

    A cone of half angle pi/2 or more holds everything.
    """
    if half >= 0.5 * pi:
        return -1e9, 1e9
    m = sub(x, apex)
    c2 = cos(half) ** 2
    ma, da = dot(m, axis), dot(d, axis)
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
    view_cone: Numbers,
    g: Numbers,
    x: Numbers,
    d: Numbers,
    low: float,
    high: float,
) -> tuple[float, float]:
    """The part of [low, high] for which x + t d is a place for R's tip.

    Least insertion is not looked at: the places above it are not convex.

    Args:
        workspace: A record of `constants`.
        view_cone: Apex, axis, half angle (7).
        g: Fulcrum of R, m.
        x: A point of the line, m.
        d: Its direction, a unit vector.
        low: Least t, m.
        high: Greatest t, m.

    Returns:
        (low, high), m; low > high if there is none.
    """
    a, b = line_in_cone(x, d, g, _DOWN, workspace.max_tilt)
    low, high = max(low, a), min(high, b)
    half = view_cone[6] - workspace.cone_margin
    if view_cone[6] >= 0.5 * pi:
        half = pi
    a, b = line_in_cone(x, d, xyz(view_cone, 0), xyz(view_cone, 3), half)
    low, high = max(low, a), min(high, b)
    m = sub(x, g)
    middle = -dot(m, d)
    reach = workspace.max_insertion**2 - dot(m, m) + middle * middle
    if reach < 0.0:
        return 1.0, 0.0
    low, high = max(low, middle - sqrt(reach)), min(high, middle + sqrt(reach))
    over = x[2] - workspace.floor
    if abs(d[2]) < 1e-12:
        return (low, high) if over >= 0.0 else (1.0, 0.0)
    if d[2] > 0.0:
        return max(low, -over / d[2]), high
    return low, min(high, -over / d[2])


@compiled
def is_inside(workspace: Any, view_cone: Numbers, g: Numbers, p: Numbers) -> bool:
    """Whether p is a place for R's tip, all limits included."""
    shaft = sub(p, g)
    if norm(shaft) < workspace.min_insertion:
        return False
    low, high = line_inside(workspace, view_cone, g, p, unit(shaft, _DOWN), 0.0, 0.0)
    return low <= high


@compiled
def borders(
    workspace: Any, view_cone: Numbers, g: Numbers, p: Numbers
) -> tuple[np.ndarray, np.ndarray]:
    """The borders near the tip: inward normals (5, 3) and the room before each, m (5).

    Least and greatest insertion, tilt, view cone, floor. A border that does not exist
    has room without end.
    """
    normals = np.zeros((5, 3))
    room = np.full(5, 1e9)
    shaft = sub(p, g)
    q = norm(shaft)
    u = unit(shaft, _DOWN)
    for i in range(3):
        normals[0, i], normals[1, i] = u[i], -u[i]
    room[0], room[1] = q - workspace.min_insertion, workspace.max_insertion - q
    for row in range(2):
        if row == 0:
            apex, axis, half = g, _DOWN, workspace.max_tilt
        else:
            apex, axis = xyz(view_cone, 0), xyz(view_cone, 3)
            half = view_cone[6] - workspace.cone_margin
            if view_cone[6] >= 0.5 * pi:
                half = pi
        ray = sub(p, apex)
        lengthwise = dot(ray, axis)
        across = along(ray, -lengthwise, axis)
        off = norm(across)
        if half < 0.5 * pi and off > 1e-9:
            sine, cosine = sqrt(1.0 - cos(half) ** 2), cos(half)
            for i in range(3):
                normals[2 + row, i] = sine * axis[i] - cosine * across[i] / off
            room[2 + row] = lengthwise * sine - off * cosine
    normals[4, 2] = 1.0
    room[4] = p[2] - workspace.floor
    return normals, room
