"""Kinematics of six balls that turn freely: ball i by R_i, in the one before."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.kinematics import put, turned
from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.posture import Array, module_angles, whole_postures
from systems.common.compiled import compiled
from systems.common.geometry import Vector, along, norm

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


@compiled
def bent_turns(x: Any, turns: Any) -> None:
    """R_i (6, 3, 3) of a posture (7,), alike in a module and without torsion."""
    delta = np.zeros(TURNS)
    for k in range(MODULES):
        a, b = x[1 + 2 * k], x[2 + 2 * k]
        across, along = math.sin(b), -math.sin(a) * math.cos(b)
        sine = math.hypot(across, along)
        size = math.atan2(sine, math.cos(a) * math.cos(b))
        for i in (6 * k, 6 * k + 3):
            delta[i] = -size * along / (sine if sine > 0.0 else 1.0)
            delta[i + 1] = size * across / (sine if sine > 0.0 else 1.0)
    straight = np.zeros((BALLS, 3, 3))
    for i in range(3):
        straight[:, i, i] = 1.0
    turned_by(straight, delta, turns)


def turns_of(x: ArrayLike) -> Array:
    """R_i (6, 3, 3) of a posture (7,), see `bent_turns`."""
    turns = np.empty((BALLS, 3, 3))
    bent_turns(whole_postures(x), turns)
    return turns


@compiled
def gaps_of(turns: Any, split: Any, torsion: Any) -> None:
    """What the paper takes to be zero, in rad, of R_i (6, 3, 3).

    Into split (3,), between the bends of a module's balls, and torsion (6,) of a ball.
    """
    bend = np.empty((BALLS, 2))
    for i in range(BALLS):
        R = turns[i]
        sine = math.hypot(R[0, 2], R[1, 2])
        size = math.atan2(sine, R[2, 2]) / (sine if sine > 0.0 else 1.0)
        bend[i, 0], bend[i, 1] = R[0, 2] * size, R[1, 2] * size
        torsion[i] = math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    for k in range(MODULES):
        apart = bend[2 * k] - bend[2 * k + 1]
        split[k] = math.hypot(apart[0], apart[1])


def gaps(turns: Array) -> tuple[Array, Array]:
    """Split of each module and torsion of each ball, as of `gaps_of`: (3,) and (6,)."""
    split, torsion = np.empty(MODULES), np.empty(BALLS)
    gaps_of(turns, split, torsion)
    return split, torsion


@compiled
def mean_bends(turns: Any) -> Any:
    """alpha1, beta1, ..., beta3 (6,) of modules, between those of their two balls."""
    bends = np.empty(2 * MODULES)
    for k in range(MODULES):
        x, y, z = turns[2 * k, :, 2] + turns[2 * k + 1, :, 2]
        bends[2 * k] = math.atan2(y, x)
        bends[2 * k + 1] = math.atan2(math.hypot(x, y), z)
    return bends


@compiled
def mean_posture(turns: Any, s: float) -> Any:
    """The posture (7,) of balls that turn by R_i, as if a module's were alike."""
    x, bends = np.empty(1 + 2 * MODULES), mean_bends(turns)
    x[0] = s
    for k in range(MODULES):
        x[2 * k + 1], x[2 * k + 2] = module_angles(bends[2 * k], bends[2 * k + 1])
    return x


def tool_pose(turns: Array, s: float, params: SnakeParams) -> Array:
    """X_WT (4, 4) of balls that turn by R_i (6, 3, 3) at a translation s."""
    X = np.eye(4)
    X[2, 3] = s
    for turn in turns:
        X[:3, :3] = X[:3, :3] @ turn
        X[:3, 3] += 2 * params.half_pitch * X[:3, 2]
    X[:3, 3] += params.tool_offset * X[:3, 2]
    return X


@compiled
def tool_of(turns: Any, s: float, h: float, tool: float) -> tuple[Vector, Vector]:
    """p_WT and the tool's axis n_WT of balls that turn by R_i (6, 3, 3)."""
    A, B = np.eye(3), np.empty((3, 3))
    p = (0.0, 0.0, s)
    for i in range(BALLS):
        times(A, turns[i], B)
        A, B = B, A
        p = along(p, 2 * h, (A[0, 2], A[1, 2], A[2, 2]))
    n = (A[0, 2], A[1, 2], A[2, 2])
    return along(p, tool, n), n


@compiled
def angles_of(turns: Any) -> Any:
    """Angles of joints Rx, Ry, Rz a ball in rad, (18,), that turn by R_i."""
    angles = np.empty(TURNS)
    for i in range(BALLS):
        R = turns[i]
        angles[3 * i] = math.atan2(-R[1, 2], R[2, 2])
        angles[3 * i + 1] = math.asin(min(max(R[0, 2], -1.0), 1.0))
        angles[3 * i + 2] = math.atan2(-R[0, 1], R[0, 0])
    return angles


@compiled
def turned_to(angles: Any, out: Any) -> None:
    """R_i of one set of the joints' angles (18,), into out (6, 3, 3)."""
    for i in range(BALLS):
        a, b, c = angles[3 * i], angles[3 * i + 1], angles[3 * i + 2]
        ca, cb, cc = math.cos(a), math.cos(b), math.cos(c)
        sa, sb, sc = math.sin(a), math.sin(b), math.sin(c)
        R = out[i]
        R[0, 0], R[0, 1], R[0, 2] = cb * cc, -cb * sc, sb
        R[1, 0], R[1, 1] = sa * sb * cc + ca * sc, ca * cc - sa * sb * sc
        R[2, 0], R[2, 1] = sa * sc - ca * sb * cc, ca * sb * sc + sa * cc
        R[1, 2], R[2, 2] = -sa * cb, ca * cb


def turns_of_angles(angles: ArrayLike) -> Array:
    """R_i (..., 6, 3, 3) of the joints' angles, (..., 18)."""
    q = np.asarray(angles, float)
    out = np.empty((*q.shape[:-1], BALLS, 3, 3))
    rows = q.reshape(-1, TURNS)
    for one, turns in zip(rows, out.reshape(-1, BALLS, 3, 3), strict=True):
        turned_to(one, turns)
    return out


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
