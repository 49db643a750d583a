"""The tool's wrench from the sensor's reading, compiled (see `tool_wrench`)."""

from math import isfinite

import numpy as np

from systems.common.compiled import compiled

Floats = np.ndarray
_GRAVITY = 9.81


@compiled
def _cross(a: Floats, b: Floats) -> Floats:
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@compiled
def shaft_of(R_WM: Floats, p_WM: Floats, v_WM: Floats, w_WM: Floats) -> Floats:
    """p_WS, u, v_WS, du/dt (12) of a mount M whose z axis is the shaft."""
    shaft = np.empty(12)
    shaft[0:3] = p_WM
    shaft[3:6] = R_WM[:, 2]
    shaft[6:9] = v_WM
    shaft[9:12] = _cross(w_WM, shaft[3:6])
    return shaft


@compiled
def wall_wrench(
    R_WM: Floats,
    shaft: Floats,
    w: Floats,
    alpha: Floats,
    a: Floats,
    force: Floats,
    moment: Floats,
    fault: Floats,
    body: Floats,
    limit: Floats,
    sleeve: Floats,
) -> Floats:
    """What the wall does to the shaft, in W.

    Args:
        R_WM: Orientation of the mount.
        shaft: p_WS, u, v_WS, du (12).
        w: Angular velocity (3).
        alpha: Angular acceleration (3).
        a: Acceleration of the sensor (3).
        force: Ideal reading, in M (3).
        moment: Ideal reading, in M (3).
        fault: What noise, drift and offset add to it (6).
        body: Mass [kg], distance of the centre [m] and transverse inertia about
            the sensor [kg m^2] of the instrument.
        limit: Ranges of a force and a moment axis.
        sleeve: Mass [kg] of the sleeve, its place and its acceleration (7).

    Returns:
        f (3), m (3) about the sensor's origin, and 1; zeros while saturated.
    """
    result = np.zeros(7)
    read = np.empty(6)
    for i in range(3):
        read[i] = force[i] + fault[i]
        read[3 + i] = moment[i] + fault[3 + i]
        if not (abs(read[i]) <= limit[0] and abs(read[3 + i]) <= limit[1]):
            return result  # a NaN is not in range either
    u = shaft[3:6]
    ddu = _cross(alpha, u) + _cross(w, shaft[9:12])
    b = a.copy()
    b[2] += _GRAVITY
    s = body[2] * ddu + body[0] * body[1] * b
    f = body[0] * (b + body[1] * ddu)
    m = _cross(u, s)
    if sleeve[0] > 0.0:
        inertia = sleeve[0] * sleeve[4:7]
        f += inertia
        m += _cross(sleeve[1:4] - shaft[0:3], inertia)
    for i in range(3):
        for j in range(3):
            f[i] -= R_WM[i, j] * read[j]
            m[i] -= R_WM[i, j] * read[3 + j]
    result[0:3], result[3:6], result[6] = f, m, 1.0
    return result if isfinite(f.sum() + m.sum()) else np.zeros(7)
