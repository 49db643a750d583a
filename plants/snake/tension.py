"""Wire tensions that balance a load, none below a minimum.

A module has three wires for two torques: with J = dL/d(a, b), (3, 2), the tensions
T solve J^T T = -tau, and adding the null vector pulls all three tighter without a
torque. It is positive over the whole domain iff tan(max_bend/2) < R/(2d), the same
inequality that makes lengths unambiguous. Distal wires pull on the modules they
run through, so module 3 comes first.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import half_turn, norm_rows
from plants.snake.jacobian import jacobian
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.posture import Array
from systems.common.compiled import compiled


@compiled
def length_gradients(
    a: float, b: float, rows: Any, R: float, h: float, e: float, J: Any
) -> None:
    """dL/d(a, b) in one module for each row of norms, into J (n, 2) (compiled)."""
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    c, xi, eta = half_turn(a, b)
    c_a, c_b = -sa * cb / (4 * c), -ca * sb / (4 * c)
    xi_a, xi_b = -xi * c_a / c, cb / (2 * c) - xi * c_b / c
    eta_a, eta_b = -ca * cb / (2 * c) - eta * c_a / c, sa * sb / (2 * c) - eta * c_b / c
    d = h - e / 2
    rho2 = R * R + d * d
    for w in range(rows.shape[0]):
        k0, k1, k2 = rows[w, 0], rows[w, 1], rows[w, 2]
        p = k0 * c + k1 * xi + k2 * eta
        slope = 2.0 if p <= 2 * d else 2 * R / np.sqrt(rho2 - p * p / 4)
        J[w, 0] = slope * (k0 * c_a + k1 * xi_a + k2 * eta_a)
        J[w, 1] = slope * (k0 * c_b + k1 * xi_b + k2 * eta_b)


@compiled
def tensions_of(
    ab: Any, tau: Any, rows: Any, R: float, h: float, e: float, least: float, T: Any
) -> None:
    """As `tensions`, into T (9,) (compiled)."""
    J = np.empty((WIRES * MODULES, 2))
    for m in range(MODULES - 1, -1, -1):
        first = WIRES * m
        length_gradients(ab[2 * m], ab[2 * m + 1], rows[first:], R, h, e, J[first:])
        load_a, load_b = -tau[2 * m], -tau[2 * m + 1]
        for w in range(first + WIRES, WIRES * MODULES):
            load_a -= J[w, 0] * T[w]
            load_b -= J[w, 1] * T[w]
        # Least-norm solution J (J^T J)^-1 load, and the null vector g_a x g_b.
        g = J[first : first + WIRES]
        aa = ab_ = bb = 0.0
        for j in range(WIRES):
            aa += g[j, 0] * g[j, 0]
            ab_ += g[j, 0] * g[j, 1]
            bb += g[j, 1] * g[j, 1]
        det = aa * bb - ab_ * ab_
        u, v = (bb * load_a - ab_ * load_b) / det, (aa * load_b - ab_ * load_a) / det
        lift = -np.inf
        sign = 1.0 if g[1, 0] * g[2, 1] > g[1, 1] * g[2, 0] else -1.0
        null = np.empty(WIRES)
        for j in range(WIRES):
            k, n = (j + 1) % WIRES, (j + 2) % WIRES
            null[j] = sign * (g[k, 0] * g[n, 1] - g[k, 1] * g[n, 0])
            T[first + j] = g[j, 0] * u + g[j, 1] * v
            lift = max(lift, (least - T[first + j]) / null[j])
        for j in range(WIRES):
            T[first + j] += lift * null[j]


def length_jacobian(ab: ArrayLike, params: SnakeParams) -> Array:
    """dL/d(a1, b1, ..., a3, b3) in m/rad at angles ab (6,): (9, 6)."""
    ab = np.asarray(ab, float)
    rows, J = norm_rows(params), np.zeros((WIRES * MODULES, 2 * MODULES))
    R, e, h = params.ball_radius, params.plate_thickness, params.half_pitch
    for m in range(MODULES):
        block = np.empty((WIRES * (MODULES - m), 2))
        length_gradients(ab[2 * m], ab[2 * m + 1], rows[WIRES * m :], R, h, e, block)
        J[WIRES * m :, 2 * m : 2 * m + 2] = block
    return J


def torques_against(
    x: ArrayLike, f_T_W: ArrayLike, params: SnakeParams, m_T_W: ArrayLike = (0, 0, 0)
) -> Array:
    """Torques on (a1, b1, ..., b3) that hold the tool against a load.

    Args:
        x: Posture, (7,).
        f_T_W: Force on the tool at its origin, in N, (3,).
        params: The snake.
        m_T_W: Moment on the tool, in Nm, (3,).

    Returns:
        tau in Nm, (6,), to be given to `tensions`.
    """
    load = np.concatenate([np.asarray(m_T_W, float), np.asarray(f_T_W, float)])
    return -jacobian(x, params)[:, 1:].T @ load


def tensions(
    ab: ArrayLike, tau: ArrayLike, params: SnakeParams, least: float = 1.0
) -> Array:
    """Smallest tensions that give the torques, each module's least one `least`.

    Args:
        ab: Angles (a1, b1, ..., b3) in rad, (6,).
        tau: Generalised forces the wires have to exert on them in Nm, (6,).
        params: The snake.
        least: Minimum tension in N, >= 0.

    Returns:
        Tensions in N, (9,).
    """
    T = np.empty(WIRES * MODULES)
    R, e, h = params.ball_radius, params.plate_thickness, params.half_pitch
    ab, tau = np.asarray(ab, float), np.asarray(tau, float)
    tensions_of(ab, tau, norm_rows(params), R, h, e, least, T)
    return T
