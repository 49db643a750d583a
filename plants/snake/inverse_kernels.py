"""The search behind the inverse kinematics, compiled.

Everything works on one pose at a time, in plain numbers; see `inverse_kinematics`
for what is solved.
"""

import math
from typing import Any

import numpy as np

from plants.snake.posture import module_angles
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, dot, xyz

REACHED = 0
BEND = 1  # outside the reach of modules 1 and 2 whatever the translation
TRAVEL_LOW = 2
TRAVEL_HIGH = 3
LAST_BEND = 4  # the tool's axis lies too far from the intermediate axis

SLACK = 1e-9
"""Limits are kept to this many rad, and m, so that poses on them are reached."""


@compiled
def half_bend(w: float, kappa: float, t_max: float) -> float:
    """Solves sin(b) (1 + kappa cos(b)) = w for t = tan(b/2), at most t_max.

    In t the left side is rational, rising and concave up to 45 deg, so Newton's
    method comes from below and needs no trigonometry (compiled).
    """
    up, down = 1 + kappa, 1 - kappa
    t = w / (2 * up)
    for _ in range(50):
        t = min(t, t_max)
        t2 = t * t
        s = 1 + t2
        f = 2 * t * (up + down * t2) / (s * s) - w
        slope = 2 * (up + 3 * down * t2) / (s * s) - 8 * t2 * (up + down * t2) / (
            s * s * s
        )
        step = f / slope
        t -= step
        if abs(step) < 1e-16 + 1e-15 * t or t > t_max + 1e-3:
            break
    return min(t, t_max)


@compiled
def _middle_axis(k: float, x: float, y: float, n: Vector, t_max: float) -> Any:
    """Axis v for a given k = cos(beta2), its error v . n - (2 k^2 - 1), and t1.

    (x, y) is the lateral part of (p_WI - 2h n)/(2h).
    """
    wx, wy = x - n[0] / (2 * k), y - n[1] / (2 * k)
    w = math.sqrt(wx * wx + wy * wy)
    t = half_bend(w, 2 + 1 / k, t_max)
    s = 1 + t * t
    sb, cb = 2 * t / s, (1 - t * t) / s
    lateral = 2 * sb * cb / w if w > 1e-300 else 0.0
    vx, vy, vz = lateral * wx, lateral * wy, cb * cb - sb * sb
    return vx * n[0] + vy * n[1] + vz * n[2] - (2 * k * k - 1), vx, vy, vz, t, w


@compiled
def _before(alpha: float, beta: float, n: Vector) -> Vector:
    """An axis of W as the end of the module (alpha, beta) has it."""
    ca, sa = math.cos(alpha), math.sin(alpha)
    c2, s2 = math.cos(2 * beta), math.sin(2 * beta)
    radial, across = ca * n[0] + sa * n[1], ca * n[1] - sa * n[0]
    t, z = c2 * radial - s2 * n[2], s2 * radial + c2 * n[2]
    return ca * t - sa * across, sa * t + ca * across, z


@compiled
def _turn_back(alpha: float, beta: float, n: Vector) -> tuple[float, float]:
    """Azimuth and bend, per ball, that take a module's end axis to n.

    n is expressed in W; (alpha, beta) is the one module before.
    """
    x, y, z = _before(alpha, beta, n)
    return math.atan2(y, x), math.atan2(math.hypot(x, y), z) / 2


@compiled
def _stroke(travel: Any, q: Any) -> int:
    """The status of a translation; one within SLACK is put on its limit."""
    if q[0] < travel[0] - SLACK:
        return TRAVEL_LOW
    if q[0] > travel[1] + SLACK:
        return TRAVEL_HIGH
    q[0] = min(max(q[0], travel[0]), travel[1])
    return REACHED


@compiled
def _positioning(
    p: Vector, n: Vector, h: float, bend: float, travel: Any, q: Any
) -> int:
    """Writes (s, alpha1, beta1, alpha2, beta2) to q; returns the status."""
    t_max = math.tan((bend + SLACK) / 2)
    x, y = p[0] / (2 * h) - n[0], p[1] / (2 * h) - n[1]
    if n[2] < 0 and math.hypot(n[0], n[1]) < SLACK and bend > math.pi / 4 - SLACK:
        # A U-turn takes both bends whole, in one plane: a circle, whose root is
        # double. Here alone the search would miss it.
        if abs(math.hypot(x, y) - 1 - math.sqrt(2)) > SLACK:
            return BEND
        q[1] = q[3] = math.atan2(y, x)
        q[2] = q[4] = math.pi / 4
        q[0] = p[2] + 2 * h
        return _stroke(travel, q)
    low, high = math.cos(bend + SLACK), 1.0
    g_low = _middle_axis(low, x, y, n, t_max)[0]
    if g_low < 0.0:
        return BEND
    g_high = _middle_axis(high, x, y, n, t_max)[0]
    # The error has one root: regula falsi (Illinois) keeps the bracket; near a
    # U-turn, where the root is almost double, every second step bisects.
    k = high
    side = 0
    for i in range(150):
        if g_high >= 0.0:
            k = high
        elif i > 12 and i % 2:
            k = (low + high) / 2
        else:
            k = (low * g_high - high * g_low) / (g_high - g_low)
        g = _middle_axis(k, x, y, n, t_max)[0]
        if abs(g) < 2e-16 or high - low < 2e-16:
            break
        if g > 0.0:
            low, g_low = k, g
            if side == 1:
                g_high /= 2
            side = 1
        else:
            high, g_high = k, g
            if side == -1:
                g_low /= 2
            side = -1
    _, _, _, vz, t, w = _middle_axis(k, x, y, n, t_max)
    if t >= t_max and w > 0:
        return BEND
    q[1] = math.atan2(y - n[1] / (2 * k), x - n[0] / (2 * k)) if w > 0.0 else 0.0
    q[2] = min(2 * math.atan(t), bend)
    q[3], q[4] = _turn_back(q[1], q[2], n)
    q[4] = min(q[4], bend)
    k = math.cos(q[4])
    q[0] = p[2] - 2 * h * (math.cos(q[2]) + vz + (vz + n[2]) / (2 * k) + n[2])
    return _stroke(travel, q)


@compiled
def _as_posture(modules: int, x: Any) -> None:
    """Takes azimuth and bend of the first modules for a and b, in place."""
    for k in range(modules):
        x[1 + 2 * k], x[2 + 2 * k] = module_angles(x[1 + 2 * k], x[2 + 2 * k])


@compiled
def solve_positioning(
    p: Vector, n: Vector, h: float, bend: float, travel: Numbers, x: Any
) -> int:
    """Puts O2 at p_WI, its axis along n_WI: (s, a1, b1, a2, b2) into x; the status.

    NaN stands in x where the bends do not reach.
    """
    x[:] = np.nan
    status = _positioning(p, n, h, bend, travel, x)
    _as_posture(2, x)
    return status


@compiled
def solve_tool(
    p: Vector,
    n: Vector,
    m: Vector,
    h: float,
    tool: float,
    bend: float,
    travel: Numbers,
    x: Any,
) -> int:
    """The posture with p_WT = p, n_WT = n, n_WI = m, into x (7,); the status."""
    x[:] = np.nan
    c = dot(m, n)
    if c < math.cos(2 * bend) - 2 * SLACK:
        return LAST_BEND
    both = math.sqrt(2 + 2 * c)
    mid = (m[0] + n[0]) / both, (m[1] + n[1]) / both, (m[2] + n[2]) / both
    O3 = along(p, -tool, n)
    status = _positioning(along(O3, -2 * h, along(mid, 1.0, n)), m, h, bend, travel, x)
    if status != BEND:
        # Undo module 1, then module 2 gives the last one's azimuth and bend.
        x[5], x[6] = _turn_back(x[3], x[4], _before(x[1], x[2], n))
    _as_posture(3, x)
    return status


@compiled
def solve_positionings(
    p: Any, n: Any, h: float, bend: float, travel: Numbers, x: Any, status: Any
) -> None:
    """As `solve_positioning` for many poses (N, 3), postures (N, 5), statuses (N,)."""
    for i in range(len(p)):
        status[i] = solve_positioning(xyz(p[i], 0), xyz(n[i], 0), h, bend, travel, x[i])


@compiled
def solve_tools(
    p: Any,
    n: Any,
    m: Any,
    h: float,
    tool: float,
    bend: float,
    travel: Numbers,
    x: Any,
    status: Any,
) -> None:
    """As `solve_tool` for many poses (N, 3), postures (N, 7), statuses (N,)."""
    for i in range(len(p)):
        at, u, v = xyz(p[i], 0), xyz(n[i], 0), xyz(m[i], 0)
        status[i] = solve_tool(at, u, v, h, tool, bend, travel, x[i])
