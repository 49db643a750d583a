"""Kinematics of the PA-10-7C in plain floats, fast enough for a control step.

Modified Denavit-Hartenberg frames, alpha = 0, -90, 90, -90, 90, -90, 90 deg, a = 0,
d = 0.317, 0, 0.45, 0, 0.48, 0, 0.07 m (the published lengths). Everything is in the
base frame B; the flange frame is that of the last link. Held against the plant by
the tests.
"""

from collections.abc import Sequence
from math import cos, sin

import numpy as np

Vector = tuple[float, float, float]

SHOULDER, UPPER_ARM, FOREARM, HAND = 0.317, 0.45, 0.48, 0.07
"""Base to shoulder, shoulder to elbow, elbow to wrist, wrist to flange, in m."""

_DH = (
    (0, SHOULDER),
    (-1, 0.0),
    (1, UPPER_ARM),
    (-1, 0.0),
    (1, FOREARM),
    (-1, 0.0),
    (1, HAND),
)
"""Sign of alpha (times 90 deg) and d in m, by joint."""


def chain(q: Sequence[float]) -> tuple[list[Vector], list[Vector], Vector, Vector]:
    """Walks the arm's chain.

    Args:
        q: Joint angles in rad (7).

    Returns:
        Axes of the joints (7 unit vectors), origins of the links' frames in m (7,
        the last is the flange), and the flange's x and y axes; all in B. The
        flange's z axis is the last joint's.
    """
    xx, xy, xz = 1.0, 0.0, 0.0
    yx, yy, yz = 0.0, 1.0, 0.0
    zx, zy, zz = 0.0, 0.0, 1.0
    px, py, pz = 0.0, 0.0, 0.0
    axes: list[Vector] = []
    origins: list[Vector] = []
    for (alpha, d), angle in zip(_DH, q, strict=True):
        if alpha < 0:  # Rx(-90 deg): y' = -z, z' = y
            yx, yy, yz, zx, zy, zz = -zx, -zy, -zz, yx, yy, yz
        elif alpha > 0:  # Rx(90 deg): y' = z, z' = -y
            yx, yy, yz, zx, zy, zz = zx, zy, zz, -yx, -yy, -yz
        if d:
            px += d * zx
            py += d * zy
            pz += d * zz
        c, s = cos(angle), sin(angle)
        xx, xy, xz, yx, yy, yz = (
            c * xx + s * yx,
            c * xy + s * yy,
            c * xz + s * yz,
            c * yx - s * xx,
            c * yy - s * xy,
            c * yz - s * xz,
        )
        axes.append((zx, zy, zz))
        origins.append((px, py, pz))
    return axes, origins, (xx, xy, xz), (yx, yy, yz)


def flange_pose(q: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Returns p_BF (3, in m) and R_BF (3x3) of the flange F."""
    axes, origins, x, y = chain(q)
    return np.array(origins[-1]), np.array((x, y, axes[-1])).T


def tool_jacobian(q: Sequence[float], reach: float) -> np.ndarray:
    """Spatial velocity Jacobian of a point on the flange's axis.

    Args:
        q: Joint angles in rad (7).
        reach: Distance of the point T from the flange along its z axis, in m.

    Returns:
        J (6x7): [w_BT; v_BT] = J v, in B, in rad/s and m/s.
    """
    axes, origins, _, _ = chain(q)
    tx, ty, tz = (p + reach * z for p, z in zip(origins[-1], axes[-1], strict=True))
    columns = []
    for (zx, zy, zz), (ox, oy, oz) in zip(axes, origins, strict=True):
        rx, ry, rz = tx - ox, ty - oy, tz - oz
        columns.append(
            (zx, zy, zz, zy * rz - zz * ry, zz * rx - zx * rz, zx * ry - zy * rx)
        )
    return np.array(columns).T


def payload_torque(
    q: Sequence[float], mass: float, distance: float, gravity: float = 9.81
) -> list[float]:
    """Joint torques that carry a payload whose centre lies on the flange's axis.

    The base stands upright (its z axis up).

    Args:
        q: Joint angles in rad (7).
        mass: Of the payload, in kg.
        distance: From the flange to the centre of mass along its z axis, in m.
        gravity: In m/s^2.

    Returns:
        Torques in Nm (7) to feed forward.
    """
    axes, origins, _, _ = chain(q)
    weight = mass * gravity
    cx = origins[-1][0] + distance * axes[-1][0]
    cy = origins[-1][1] + distance * axes[-1][1]
    return [
        weight * (zx * (cy - oy) - zy * (cx - ox))
        for (zx, zy, _), (ox, oy, _) in zip(axes, origins, strict=True)
    ]
