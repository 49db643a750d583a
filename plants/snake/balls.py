"""Kinematics of six balls that turn freely: ball i by R_i, in the one before."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.kinematics import put, turned
from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.posture import Array, bends_of, whole_postures
from systems.common.compiled import compiled
from systems.common.geometry import along, norm

BALLS = 2 * MODULES
TURNS = 3 * BALLS
"""Freedoms: three of each ball."""


@compiled
def times(A: Any, B: Any, out: Any) -> None:
    """A B of 3 x 3 matrices; `@` costs a call of BLAS and a new array."""
    for a in range(3):
        for b in range(3):
            out[a, b] = A[a, 0] * B[0, b] + A[a, 1] * B[1, b] + A[a, 2] * B[2, b]


@compiled
def turned_by(turns: Any, delta: Any, out: Any) -> None:
    """R_i exp(delta_i) of each ball."""
    E = np.empty((3, 3))
    for i in range(BALLS):
        d = (delta[3 * i], delta[3 * i + 1], delta[3 * i + 2])
        angle = norm(d)
        small = angle < 1e-8
        a = 1.0 if small else math.sin(angle) / angle
        b = 0.5 if small else (1 - math.cos(angle)) / angle**2
        for k in range(3):
            for n in range(3):
                E[k, n] = b * d[k] * d[n]
            E[k, k] += math.cos(angle)
        for k in range(3):
            E[k, (k + 1) % 3] -= a * d[(k + 2) % 3]
            E[(k + 1) % 3, k] += a * d[(k + 2) % 3]
        times(turns[i], E, out[i])


def turns_of(x: ArrayLike) -> Array:
    """R_i (6, 3, 3) of a posture (7,): alike in a module, and without torsion."""
    q = bends_of(whole_postures(x))
    turns = np.broadcast_to(np.eye(3), (BALLS, 3, 3)).copy()
    alpha, beta = q[1::2], q[2::2]
    axes = np.stack([-beta * np.sin(alpha), beta * np.cos(alpha), 0 * beta], axis=1)
    out = np.empty_like(turns)
    turned_by(turns, np.repeat(axes, 2, axis=0).ravel(), out)
    return out


def gaps(turns: Array) -> tuple[Array, Array]:
    """What the paper takes to be zero, in rad.

    Args:
        turns: R_i, (..., 6, 3, 3).

    Returns:
        Split of each module, between the bends of its two balls, (..., 3), and each
        ball's torsion, (..., 6).
    """
    x, y, z = turns[..., 0, 2], turns[..., 1, 2], turns[..., 2, 2]
    sine = np.hypot(x, y)
    size = np.arctan2(sine, z) / np.where(sine > 0.0, sine, 1.0)
    bend = np.stack([x, y], axis=-1) * size[..., None]
    split = np.linalg.norm(bend[..., 0::2, :] - bend[..., 1::2, :], axis=-1)
    torsion = np.arctan2(
        turns[..., 1, 0] - turns[..., 0, 1], turns[..., 0, 0] + turns[..., 1, 1]
    )
    return split, torsion


def mean_bends(turns: Array) -> Array:
    """alpha1, beta1, ..., beta3 (6,) of modules, between those of their two balls."""
    axes = turns[:, :, 2]
    mean = axes[0::2] + axes[1::2]
    alpha = np.arctan2(mean[:, 1], mean[:, 0])
    beta = np.arctan2(np.hypot(mean[:, 0], mean[:, 1]), mean[:, 2])
    return np.column_stack([alpha, beta]).ravel()


def tool_pose(turns: Array, s: float, params: SnakeParams) -> Array:
    """X_WT (4, 4) of balls that turn by R_i (6, 3, 3) at a translation s."""
    X = np.eye(4)
    X[2, 3] = s
    for turn in turns:
        X[:3, :3] = X[:3, :3] @ turn
        X[:3, 3] += 2 * params.half_pitch * X[:3, 2]
    X[:3, 3] += params.tool_offset * X[:3, 2]
    return X


def angles_of(turns: Array) -> Array:
    """Angles of joints Rx, Ry, Rz a ball in rad, (18,), that turn by R_i."""
    a = np.arctan2(-turns[:, 1, 2], turns[:, 2, 2])
    b = np.arcsin(np.clip(turns[:, 0, 2], -1.0, 1.0))
    c = np.arctan2(-turns[:, 0, 1], turns[:, 0, 0])
    return np.stack([a, b, c], axis=1).ravel()


def turns_of_angles(angles: ArrayLike) -> Array:
    """R_i (..., 6, 3, 3) of the joints' angles, (..., 18)."""
    q = np.asarray(angles, float)
    q = q.reshape(*q.shape[:-1], BALLS, 3)
    ca, cb, cc = np.moveaxis(np.cos(q), -1, 0)
    sa, sb, sc = np.moveaxis(np.sin(q), -1, 0)
    rows = [
        [cb * cc, -cb * sc, sb],
        [sa * sb * cc + ca * sc, ca * cc - sa * sb * sc, -sa * cb],
        [sa * sc - ca * sb * cc, ca * sb * sc + sa * cc, ca * cb],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def ball_posture(x: ArrayLike) -> Array:
    """s, then joints Rx, Ry, Rz a ball (19,), of a posture (7,)."""
    return np.append(np.asarray(x, float)[0], angles_of(turns_of(x)))


@compiled
def ball_chain(
    q: Any, h: float, tool: float, o: Any, e: Any, f: Any, n: Any, out: Any
) -> None:
    """As `kinematics.chain`, of free balls: s, then joints Rx, Ry, Rz a ball (19,)."""
    p = along(o, q[0], n)
    for i in range(BALLS):
        put(p, out[i])
        a, b, c = q[1 + 3 * i], q[2 + 3 * i], q[3 + 3 * i]
        f, n = turned(f, n, math.cos(a), math.sin(a))
        e, n = turned(e, n, math.cos(b), -math.sin(b))
        e, f = turned(e, f, math.cos(c), math.sin(c))
        p = along(p, 2 * h, n)
    put(p, out[6])
    put(along(p, tool, n), out[7])


def corners_of(turns: Array, s: ArrayLike, params: SnakeParams) -> Array:
    """Six ball centres, O3 and the tool in W, as `kinematics.centreline`.

    Args:
        turns: R_i, (..., 6, 3, 3).
        s: Translation in m, (...).
        params: The snake.

    Returns:
        Points in m, (..., 8, 3).
    """
    p = np.zeros((*turns.shape[:-3], 3))
    p[..., 2] = s
    axes, points = np.eye(3), [p]
    reach = 2 * params.half_pitch
    for i in range(BALLS):
        axes = axes @ turns[..., i, :, :]
        points.append(points[-1] + reach * axes[..., 2])
    points.append(points[-1] + params.tool_offset * axes[..., 2])
    return np.stack(points, axis=-2)
