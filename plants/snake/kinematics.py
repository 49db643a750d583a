"""Forward kinematics: equation (1), the whole robot, and its Jacobians.

A posture q = (s, alpha1, beta1, alpha2, beta2, alpha3, beta3): translation in m,
azimuth and bend *per ball* of each module in rad. Frames: W is the channel's
frame with z along the robot; Ok stands at the first ball centre of module k + 1,
not on its plate (O0 at distance s along z; O3 lies 2 h past the last ball). T is
the tool, `tool_offset` past O3 along its z.

All functions take one posture or an array of them (the last axis is the posture)
and broadcast. The heavy ones are compiled, and can be called from compiled code.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plants.snake.parameters import SnakeParams
from systems.common.compiled import compiled

Array = NDArray[np.float64]

POINTS = 8
"""Corners of the centreline: six ball centres, O3 and the tool."""


def module_transform(alpha: ArrayLike, beta: ArrayLike, h: float) -> Array:
    """X_O0O1 of one module, equation (1) in the usual homogeneous form.

    The paper prints the homogeneous row and column first.

    Args:
        alpha: Azimuth of the bend in rad, (...).
        beta: Bend of each ball in rad, (...).
        h: Half the distance between two ball centres, in m.

    Returns:
        Transforms, (..., 4, 4).
    """
    alpha, beta = np.broadcast_arrays(np.asarray(alpha, float), np.asarray(beta, float))
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    c2, s2 = cb * cb - sb * sb, 2 * sb * cb
    X = np.zeros((*alpha.shape, 4, 4))
    X[..., 0, 0] = ca * ca * c2 + sa * sa
    X[..., 1, 1] = sa * sa * c2 + ca * ca
    X[..., 0, 1] = X[..., 1, 0] = ca * sa * (c2 - 1)
    X[..., 0, 2] = ca * s2
    X[..., 1, 2] = sa * s2
    X[..., 2, 0] = -ca * s2
    X[..., 2, 1] = -sa * s2
    X[..., 2, 2] = c2
    X[..., 0, 3] = 2 * h * ca * (s2 + sb)
    X[..., 1, 3] = 2 * h * sa * (s2 + sb)
    X[..., 2, 3] = 2 * h * (cb + c2)
    X[..., 3, 3] = 1.0
    return X


def to_universal(alpha: ArrayLike, beta: ArrayLike) -> tuple[Array, Array]:
    """Angles (a, b) of the non-singular form: each ball turns Rx(a) Ry(b).

    A module is Rx(a) Ry(b) Tz(2h) Ry(b) Rx(a) Tz(2h), smooth at beta = 0.
    """
    sb = np.sin(beta)
    return np.arctan2(-sb * np.sin(alpha), np.cos(beta)), np.arcsin(sb * np.cos(alpha))


def from_universal(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Azimuth and bend (alpha, beta) from the non-singular angles."""
    x, y = np.sin(b), -np.sin(a) * np.cos(b)
    return np.arctan2(y, x), np.arctan2(np.hypot(x, y), np.cos(a) * np.cos(b))


@compiled
def advance(R: Any, p: Any, alpha: float, beta: float, h: float) -> None:
    """Moves the frame (R, p) to the end of a module, in place (compiled)."""
    ca, sa = np.cos(alpha), np.sin(alpha)
    cb, sb = np.cos(beta), np.sin(beta)
    c2, s2 = cb * cb - sb * sb, 2 * sb * cb
    lateral, axial = 2 * h * (s2 + sb), 2 * h * (cb + c2)
    for i in range(3):
        # Columns x, y seen along the bend: t towards alpha, n across.
        t = ca * R[i, 0] + sa * R[i, 1]
        n = ca * R[i, 1] - sa * R[i, 0]
        z = R[i, 2]
        p[i] += lateral * t + axial * z
        t_end = c2 * t - s2 * z
        R[i, 0] = ca * t_end - sa * n
        R[i, 1] = sa * t_end + ca * n
        R[i, 2] = s2 * t + c2 * z


@compiled
def _forward(q: Any, h: float, tool: float, X: Any) -> None:
    R, p = np.empty((3, 3)), np.empty(3)
    for i in range(q.shape[0]):
        R[:] = 0.0
        R[0, 0] = R[1, 1] = R[2, 2] = 1.0
        p[0] = p[1] = 0.0
        p[2] = q[i, 0]
        for k in range(3):
            advance(R, p, q[i, 1 + 2 * k], q[i, 2 + 2 * k], h)
        for r in range(3):
            X[i, r, 0], X[i, r, 1], X[i, r, 2] = R[r, 0], R[r, 1], R[r, 2]
            X[i, r, 3] = p[r] + tool * R[r, 2]
            X[i, 3, r] = 0.0
        X[i, 3, 3] = 1.0


@compiled
def _centreline(q: Any, h: float, tool: float, out: Any) -> None:
    R, p = np.empty((3, 3)), np.empty(3)
    for i in range(q.shape[0]):
        R[:] = 0.0
        R[0, 0] = R[1, 1] = R[2, 2] = 1.0
        p[0] = p[1] = 0.0
        p[2] = q[i, 0]
        for k in range(3):
            alpha, beta = q[i, 1 + 2 * k], q[i, 2 + 2 * k]
            lateral = 2 * h * np.sin(beta)
            x, y = lateral * np.cos(alpha), lateral * np.sin(alpha)
            z = 2 * h * np.cos(beta)
            for r in range(3):
                out[i, 2 * k, r] = p[r]
                out[i, 2 * k + 1, r] = p[r] + R[r, 0] * x + R[r, 1] * y + R[r, 2] * z
            advance(R, p, alpha, beta, h)
        for r in range(3):
            out[i, 6, r] = p[r]
            out[i, 7, r] = p[r] + tool * R[r, 2]


def postures(q: ArrayLike) -> Array:
    """Checks the shape of postures.

    Raises:
        ValueError: If the last axis is not 7 long.
    """
    q = np.asarray(q, float)
    if q.ndim == 0 or q.shape[-1] != 7:
        raise ValueError(
            f"q has shape {q.shape}, a posture has 7 numbers on the last axis: "
            "s, alpha1, beta1, alpha2, beta2, alpha3, beta3"
        )
    return q


def forward(q: ArrayLike, params: SnakeParams) -> Array:
    """X_WT, pose of the tool. Postures (..., 7) to transforms (..., 4, 4)."""
    q = postures(q)
    X = np.empty((*q.shape[:-1], 4, 4))
    _forward(
        np.ascontiguousarray(q.reshape(-1, 7)),
        params.half_pitch,
        params.tool_offset,
        X.reshape(-1, 4, 4),
    )
    return X


def centreline(q: ArrayLike, params: SnakeParams) -> Array:
    """Corners of the robot's axis in W: six ball centres, O3 and the tool.

    Between two corners the axis is straight, so these are all a collision check
    needs. Postures (..., 7) to points (..., 8, 3).
    """
    q = postures(q)
    points = np.empty((*q.shape[:-1], POINTS, 3))
    _centreline(
        np.ascontiguousarray(q.reshape(-1, 7)),
        params.half_pitch,
        params.tool_offset,
        points.reshape(-1, POINTS, 3),
    )
    return points


def frames(q: Sequence[float] | Array, params: SnakeParams) -> list[Array]:
    """X_WO0 to X_WO3 of one posture (7,): four transforms (4, 4)."""
    q = postures(q)
    X = np.eye(4)
    X[2, 3] = q[0]
    chain = [X]
    for k in range(3):
        step = module_transform(q[1 + 2 * k], q[2 + 2 * k], params.half_pitch)
        chain.append(chain[-1] @ step)
    return chain


def limit_excess(q: ArrayLike, params: SnakeParams) -> Array:
    """How far each limit is exceeded: (s, beta1, beta2, beta3), 0 if kept.

    The bend's limit is a cone, beta <= max_bend whatever the azimuth, not a box
    in (a, b), whose corners reach 60 deg.

    Args:
        q: Postures (..., 7); a beta < 0 counts as its size.
        params: The snake.

    Returns:
        Excess in m (s, signed: < 0 below s_min) and rad, (..., 4).
    """
    q = postures(q)
    excess = np.empty((*q.shape[:-1], 4))
    low, high = params.travel
    excess[..., 0] = np.minimum(q[..., 0] - low, 0.0) + np.maximum(q[..., 0] - high, 0)
    excess[..., 1:] = np.maximum(np.abs(q[..., 2::2]) - params.max_bend, 0.0)
    return excess
