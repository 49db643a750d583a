"""Elastic wires: tensions from stretch, and the torques that they exert."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import add_module, half_turn, norm_rows
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.posture import Array
from plants.snake.tension import length_gradients
from systems.common.compiled import compiled


@compiled
def _pull(
    ab: Any,
    ab_rate: Any,
    wound: Any,
    wound_rate: Any,
    whole: Any,
    rows: Any,
    R: float,
    e: float,
    h: float,
    stiffness: float,
    damping: float,
    T: Any,
    tau: Any,
) -> None:
    count = WIRES * MODULES
    L, rate = np.zeros(count), np.zeros(count)
    J = np.empty((MODULES, count, 2))
    for m in range(MODULES):
        a, b = ab[2 * m], ab[2 * m + 1]
        first = WIRES * m
        length_gradients(a, b, rows[first:], R, h, e, J[m, first:])
        add_module(half_turn(a, b), rows, m, R, e, h, 1.0, L)
        for w in range(first, count):
            rate[w] += J[m, w, 0] * ab_rate[2 * m] + J[m, w, 1] * ab_rate[2 * m + 1]
    tau[:] = 0.0
    for w in range(count):
        pull = stiffness * (L[w] - wound[w]) + damping * (rate[w] - wound_rate[w])
        T[w] = max(pull, 0.0) * whole[w]
        for m in range(w // WIRES + 1):
            tau[2 * m] -= J[m, w, 0] * T[w]
            tau[2 * m + 1] -= J[m, w, 1] * T[w]


def elastic_pull(
    ab: ArrayLike,
    ab_rate: ArrayLike,
    wound: ArrayLike,
    wound_rate: ArrayLike,
    params: SnakeParams,
    drive: SnakeDriveParams,
    whole: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Tensions of elastic wires, T = max(0, k (L - L_d) + c (dL - dL_d)/dt).

    Args:
        ab: Angles (a1, b1, ..., b3) in rad, (6,).
        ab_rate: Their rates in rad/s, (6,).
        wound: L_d, what the drums have wound out, in m, (9,).
        wound_rate: Its rates in m/s, (9,).
        params: Geometry.
        drive: Stiffness k and damping c.
        whole: 1 for each wire that is whole, 0 for a broken one, (9,).

    Returns:
        Tensions in N, (9,), and -(dL/d(a, b))^T T in Nm, (6,).
    """
    T, tau = np.empty(WIRES * MODULES), np.empty(2 * MODULES)
    _pull(
        np.asarray(ab, float),
        np.asarray(ab_rate, float),
        np.asarray(wound, float),
        np.asarray(wound_rate, float),
        _WHOLE if whole is None else np.asarray(whole, float),
        norm_rows(params),
        params.ball_radius,
        params.plate_thickness,
        params.half_pitch,
        drive.wire_stiffness,
        drive.wire_damping,
        T,
        tau,
    )
    return T, tau


_WHOLE = np.ones(WIRES * MODULES)
