"""Forward kinematics: equation (1), the whole robot, and its centreline.

Frames: W is the channel's frame with z along the robot; Ok stands at the first ball
centre of module k + 1, not on its plate (O0 at distance s along z; O3 lies 2 h past the
last ball). T is the tool, `tool_offset` past O3 along its z.

All functions take one posture (`plants.snake.posture`) or an array of them (the last
axis is the posture) and broadcast.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array, bends_of, whole_postures
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along

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


@compiled
def turned(u: Numbers, v: Numbers, c: float, s: float) -> tuple[Vector, Vector]:
    """Axes c u + s v and c v - s u: two of a frame's axes turned in their plane."""
    return (
        (c * u[0] + s * v[0], c * u[1] + s * v[1], c * u[2] + s * v[2]),
        (c * v[0] - s * u[0], c * v[1] - s * u[1], c * v[2] - s * u[2]),
    )


@compiled
def corners(x: Any, h: float, tool: float, out: Any) -> tuple[Vector, Vector, Vector]:
    """Six ball centres, O3 and the tool of a posture (7,), into out (8, 3).

    Returns:
        The axes x, y, z of T in W.
    """
    e, f, n = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return chain(x, h, tool, (0.0, 0.0, 0.0), e, f, n, out)


@compiled
def chain(
    x: Any, h: float, tool: float, o: Any, e: Any, f: Any, n: Any, out: Any
) -> tuple[Vector, Vector, Vector]:
    """As `corners`, from a frame with origin o and axes e, f, n."""
    p = along(o, x[0], n)
    for k in range(3):
        ca, sa = math.cos(x[1 + 2 * k]), math.sin(x[1 + 2 * k])
        cb, sb = math.cos(x[2 + 2 * k]), math.sin(x[2 + 2 * k])
        for half in range(2):
            put(p, out[2 * k + half])
            if half == 0:  # Rx(a) Ry(b)
                f, n = turned(f, n, ca, sa)
                e, n = turned(e, n, cb, -sb)
            else:  # Ry(b) Rx(a)
                e, n = turned(e, n, cb, -sb)
                f, n = turned(f, n, ca, sa)
            p = along(p, 2 * h, n)
    put(p, out[6])
    put(along(p, tool, n), out[7])
    return e, f, n


@compiled
def link_axis(c: Any, i: int, h: float) -> Vector:
    """The robot's axis between corners i and i + 1 of c (8, 3), i < 6."""
    return (
        (c[i + 1, 0] - c[i, 0]) / (2 * h),
        (c[i + 1, 1] - c[i, 1]) / (2 * h),
        (c[i + 1, 2] - c[i, 2]) / (2 * h),
    )


@compiled
def put(p: Numbers, row: Any) -> None:
    """Writes a point into a row."""
    row[0], row[1], row[2] = p[0], p[1], p[2]


@compiled
def _centreline(x: Any, h: float, tool: float, out: Any) -> None:
    for i in range(len(x)):
        corners(x[i], h, tool, out[i])


@compiled
def _forward(x: Any, h: float, tool: float, X: Any) -> None:
    c = np.empty((POINTS, 3))
    for i in range(len(x)):
        axes = corners(x[i], h, tool, c)
        for r in range(3):
            for k in range(3):
                X[i, r, k] = axes[k][r]
            X[i, r, 3] = c[7, r]
            X[i, 3, r] = 0.0
        X[i, 3, 3] = 1.0


def forward(x: ArrayLike, params: SnakeParams) -> Array:
    """X_WT, pose of the tool. Postures (..., 7) to transforms (..., 4, 4)."""
    x = whole_postures(x)
    X = np.empty((*x.shape[:-1], 4, 4))
    rows = np.ascontiguousarray(x.reshape(-1, 7))
    _forward(rows, params.half_pitch, params.tool_offset, X.reshape(-1, 4, 4))
    return X


def centreline(x: ArrayLike, params: SnakeParams) -> Array:
    """Corners of the robot's axis in W: six ball centres, O3 and the tool.

    Between two corners the axis is straight, so these are all a collision check
    needs. Postures (..., 7) to points (..., 8, 3).
    """
    x = whole_postures(x)
    out = np.empty((*x.shape[:-1], POINTS, 3))
    rows = np.ascontiguousarray(x.reshape(-1, 7))
    h, tool = params.half_pitch, params.tool_offset
    _centreline(rows, h, tool, out.reshape(-1, POINTS, 3))
    return out


def frames(x: ArrayLike, params: SnakeParams) -> list[Array]:
    """X_WO0 to X_WO3 of one posture (7,): four transforms (4, 4)."""
    q = bends_of(whole_postures(x))
    X = np.eye(4)
    X[2, 3] = q[0]
    chain = [X]
    for alpha, beta in q[1:].reshape(-1, 2):
        chain.append(chain[-1] @ module_transform(alpha, beta, params.half_pitch))
    return chain
