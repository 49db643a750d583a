"""The wall's spring as the wrist's sensor sees it (paper section 3, Figure 3).

A straight shaft leaves the sensor's origin S along the unit vector u. The wall
pulls the shaft towards the true fulcrum I; the sleeve slides to the foot of the
perpendicular from I, so the contact lies at p_C = p_S + lambda u with

    lambda = u . (p_I - p_S),
    f = K P (p_I - p_S) + D P (v_I - v_S - lambda du/dt),   P = 1 - u u^T,
    m = lambda u x f                                  (about the sensor's origin).

Only the four lateral components carry information. With a lateral basis e1, e2
= u x e1 they are z = (f1, f2, m1, m2) with m1 = -lambda f2, m2 = lambda f1.
"""

from math import sqrt

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import cross
from systems.common.signal import Vector


@compiled
def lateral_basis(u: Numbers) -> tuple[Vector, Vector]:
    """Two unit vectors e1, e2 = u x e1 across a unit vector u (3)."""
    x, y, z = u[0], u[1], u[2]
    if abs(x) < 0.8:  # across the world's x axis, unless u is close to it
        n = sqrt(y * y + z * z)
        e1 = (0.0, z / n, -y / n)
    else:
        n = sqrt(x * x + z * z)
        e1 = (-z / n, 0.0, x / n)
    return e1, cross(u, e1)
