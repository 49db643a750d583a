"""The search behind the inverse kinematics, compiled.

Everything works on one pose at a time, in plain numbers; see `inverse_kinematics`
for what is solved.
"""

import math
from typing import Any

import numpy as np

from systems.common.compiled import compiled

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
def _middle_axis(k: float, x: float, y: float, n: Any, t_max: float) -> Any:
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
def _turn_back(alpha: float, beta: float, n: Any) -> Any:
    """Azimuth and bend, per ball, that take a module's end axis to n.

    n is expressed in W; (alpha, beta) is the one module before.
    """
    ca, sa = math.cos(alpha), math.sin(alpha)
    c2, s2 = math.cos(2 * beta), math.sin(2 * beta)
    along, across = ca * n[0] + sa * n[1], ca * n[1] - sa * n[0]
    t, z = c2 * along - s2 * n[2], s2 * along + c2 * n[2]
    x, y = ca * t - sa * across, sa * t + ca * across
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
def _positioning(p: Any, n: Any, h: float, bend: float, travel: Any, q: Any) -> int:
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
def solve_positionings(
    p: Any, n: Any, h: float, bend: float, travel: Any, q: Any, status: Any
) -> None:
    """Positioning postures (N, 5) and statuses (N,) for p_WI, n_WI (N, 3) (compiled).

    NaN stands in q where the bends do not reach.
    """
    for i in range(p.shape[0]):
        q[i, :] = np.nan
        status[i] = _positioning(p[i], n[i], h, bend, travel, q[i])


@compiled
def solve_tools(
    p: Any,
    n: Any,
    m: Any,
    h: float,
    tool: float,
    bend: float,
    travel: Any,
    q: Any,
    status: Any,
) -> None:
    """Postures (N, 7) and statuses (N,) for p_WT, n_WT, m = n_WI (N, 3) (compiled)."""
    p_I = np.empty(3)
    for i in range(p.shape[0]):
        q[i, :] = np.nan
        c = m[i, 0] * n[i, 0] + m[i, 1] * n[i, 1] + m[i, 2] * n[i, 2]
        if c < math.cos(2 * bend) - 2 * SLACK:
            status[i] = LAST_BEND
            continue
        both = math.sqrt(2 + 2 * c)
        for r in range(3):
            mid = (m[i, r] + n[i, r]) / both
            p_I[r] = p[i, r] - tool * n[i, r] - 2 * h * (mid + n[i, r])
        status[i] = _positioning(p_I, m[i], h, bend, travel, q[i])
        if status[i] != BEND:
            # Undo module 1, then module 2 gives the last one's azimuth and bend.
            a, b = q[i, 1], q[i, 2]
            ca, sa, c2, s2 = math.cos(a), math.sin(a), math.cos(2 * b), math.sin(2 * b)
            along, across = ca * n[i, 0] + sa * n[i, 1], ca * n[i, 1] - sa * n[i, 0]
            t, z = c2 * along - s2 * n[i, 2], s2 * along + c2 * n[i, 2]
            p_I[0], p_I[1], p_I[2] = ca * t - sa * across, sa * t + ca * across, z
            q[i, 5], q[i, 6] = _turn_back(q[i, 3], q[i, 4], p_I)
