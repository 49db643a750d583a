"""Wire lengths from postures, equations (2) and (3), and back (paper, IV.B.2, IV.C).

A wire hangs between the points P_i and P'_i of two plates across a ball. The paper
needs ||P_i P'_i||; it is a perfect square, and linear in the half turn of a ball

    u = (cos(beta/2), sin(beta/2) cos(alpha), sin(beta/2) sin(alpha)),   |u| = 1:
    p_i = ||P_i P'_i|| = (2h - e) u_0 - 2R (u_1 cos(phi_i) + u_2 sin(phi_i)).

So three wires of a module give u by one constant 3 x 3 matrix, smooth at beta = 0,
and |u|^2 - 1 says how well the redundant third wire agrees: a slack or broken wire
shows there. No elimination is needed; `two_wires` holds the paper's own choice.

Wires count from the base: 0 to 2 are module 1's, 3 to 5 module 2's (they run
through module 1 at their own azimuths), 6 to 8 module 3's. Lengths run from the
base plate's middle to that of the module's end plate, without what is on the drum;
the drums ride on the translation.
"""

from dataclasses import dataclass
from functools import lru_cache
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.posture import Array, bends_of, whole_postures
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, dot, unit


@compiled
def length_of_norm(p: float, R: float, e: float, h: float) -> float:
    """Length L_i in one module for p = ||P_i P'_i||, (2) and (3) (compiled)."""
    d = h - e / 2
    if p <= 2 * d:
        return 2 * p + 2 * e
    arc = math.asin(min(p / (2 * math.sqrt(R * R + d * d)), 1.0)) - math.atan(d / R)
    return 4 * h + 4 * R * arc


@compiled
def norm_of_length(L: float, R: float, e: float, h: float) -> float:
    """Inverse of `length_of_norm`; NaN for a length that no wire has (compiled)."""
    if 4 * h >= L:
        return (L - 2 * e) / 2 if 2 * e <= L else math.nan
    d = h - e / 2
    angle = (L - 4 * h) / (4 * R) + math.atan(d / R)
    if angle > math.pi / 2:
        return math.nan
    return 2 * math.sqrt(R * R + d * d) * math.sin(angle)


@compiled
def half_turn(a: float, b: float) -> Vector:
    """U of a module with the angles a and b."""
    c = math.sqrt((1 + math.cos(a) * math.cos(b)) / 2)
    return c, math.sin(b) / (2 * c), -math.sin(a) * math.cos(b) / (2 * c)


@compiled
def add_module(
    u: Numbers, rows: Any, m: int, R: float, e: float, h: float, sign: float, L: Any
) -> None:
    """Adds a module's share, times sign, to all wires through it (compiled)."""
    for w in range(WIRES * m, WIRES * MODULES):
        L[w] += sign * length_of_norm(dot(rows[w], u), R, e, h)


@compiled
def lengths(x: Any, rows: Any, R: float, e: float, h: float, L: Any) -> None:
    """Lengths of the wires of postures x (n, 7), into L (n, 9) (compiled)."""
    for i in range(len(x)):
        L[i] = 0.0
        for m in range(MODULES):
            u = half_turn(x[i, 1 + 2 * m], x[i, 2 + 2 * m])
            add_module(u, rows, m, R, e, h, 1.0, L[i])


@compiled
def angles(
    L: Any, rows: Any, inverse: Any, R: float, e: float, h: float, ab: Any, off: Any
) -> None:
    """Angles ab (n, 6) and residuals off (n, 3) of lengths L (n, 9) (compiled)."""
    left, p = np.empty(WIRES * MODULES), np.empty(WIRES)
    for i in range(len(L)):
        left[:] = L[i]
        for m in range(MODULES):
            for j in range(WIRES):
                p[j] = norm_of_length(left[WIRES * m + j], R, e, h)
            back = inverse[m]
            u = (dot(back[0], p), dot(back[1], p), dot(back[2], p))
            square = dot(u, u)
            off[i, m] = square - 1.0
            ab[i, 2 * m] = math.atan2(-2 * u[0] * u[2], 2 * u[0] * u[0] - square)
            ab[i, 2 * m + 1] = math.asin(2 * u[0] * u[1] / square)
            if m < MODULES - 1:
                add_module(unit(u), rows, m, R, e, h, -1.0, left)


@lru_cache(maxsize=16)
def matrices(R: float, d: float, first_azimuths: tuple[float, ...]) -> Any:
    """Rows that take u to p_i, (9, 3), and each module's inverse, (3, 3, 3)."""
    turns = 2 * np.pi / WIRES * np.arange(WIRES)
    phi = np.add.outer(np.array(first_azimuths), turns).ravel()
    rows = np.stack(
        [np.full_like(phi, 2 * d), -2 * R * np.cos(phi), -2 * R * np.sin(phi)], axis=1
    )
    return rows, np.ascontiguousarray(np.linalg.inv(rows.reshape(MODULES, WIRES, 3)))


def norm_rows(params: SnakeParams) -> Array:
    """Rows that take u to p_i, one a wire, (9, 3) in m."""
    return matrices(params.ball_radius, params.face, tuple(params.first_azimuths))[0]


def _geometry(params: SnakeParams) -> tuple[float, float, float]:
    return params.ball_radius, params.plate_thickness, params.half_pitch


def wire_lengths(x: ArrayLike, params: SnakeParams) -> Array:
    """Lengths of the nine wires in m, equations (2) and (3).

    Args:
        x: Postures (..., 7).
        params: The snake.

    Returns:
        Lengths (..., 9).
    """
    x = whole_postures(x)
    L = np.empty((*x.shape[:-1], WIRES * MODULES))
    lengths(
        np.ascontiguousarray(x.reshape(-1, 7)),
        norm_rows(params),
        *_geometry(params),
        L.reshape(-1, WIRES * MODULES),
    )
    return L


@dataclass
class Angles:
    """A posture's angles from wire lengths.

    Attributes:
        ab: a1, b1, ..., a3, b3 in rad, (..., 6). NaN from the first module on whose
            wires have lengths that no posture has.
        residual: |u|^2 - 1 of each module, (..., 3): 0 if its three wires agree.
    """

    ab: Array
    residual: Array


def angles_of_lengths(L: ArrayLike, params: SnakeParams) -> Angles:
    """Forward actuation from all wires, module after module (paper, IV.C).

    Args:
        L: Lengths in m, (..., 9).
        params: The snake.
    """
    L = np.asarray(L, float)
    if L.ndim == 0 or L.shape[-1] != WIRES * MODULES:
        raise ValueError(f"L has shape {L.shape}, expected nine wires on the last axis")
    rows, inverse = matrices(
        params.ball_radius, params.face, tuple(params.first_azimuths)
    )
    ab = np.empty((*L.shape[:-1], 2 * MODULES))
    residual = np.empty((*L.shape[:-1], MODULES))
    angles(
        np.ascontiguousarray(L.reshape(-1, WIRES * MODULES)),
        rows,
        inverse,
        *_geometry(params),
        ab.reshape(-1, 2 * MODULES),
        residual.reshape(-1, MODULES),
    )
    return Angles(ab, residual)


def length_range(params: SnakeParams) -> tuple[Array, Array]:
    """Least and largest length of each wire over all postures in m, (9,) each.

    A wire is shortest with every module bent to its side and longest with every
    module bent away.
    """
    half = params.max_bend / 2
    d, R = params.face, params.ball_radius
    c, s = 2 * d * math.cos(half), 2 * R * math.sin(half)
    through: Array = np.repeat(np.arange(1, MODULES + 1), WIRES)
    shortest, longest = (length_of_norm(p, *_geometry(params)) for p in (c - s, c + s))
    return through * shortest, through * longest


def checked_angles(L: ArrayLike, params: SnakeParams, tolerance: float = 1e-6) -> Array:
    """a1, b1, ..., b3 (6,) for one set of lengths (9,) that a posture must have.

    Args:
        L: Lengths in m, (9,).
        params: The snake.
        tolerance: How far, in m, the lengths may be from a posture's.

    Raises:
        ValueError: If no posture has these lengths; it names wire or module, what
            is expected, and the nearest lengths where there are any.
    """
    L = np.asarray(L, float)
    low, high = length_range(params)
    for w in np.flatnonzero(~((low - tolerance <= L) & (high + tolerance >= L))):
        raise ValueError(
            f"wire {w} of module {w // WIRES + 1}: length {1e3 * L[w]:.3f} mm, no "
            f"posture is outside {1e3 * low[w]:.3f} to {1e3 * high[w]:.3f} mm"
        )
    x = np.append(0.0, angles_of_lengths(L, params).ab)
    nearest = wire_lengths(x, params)
    for m in range(MODULES):
        beta = float(bends_of(x)[2 + 2 * m])
        if not beta <= params.max_bend + tolerance / params.ball_radius:
            raise ValueError(
                f"module {m + 1}: these lengths bend it by beta={beta:.4f} rad, "
                f"beyond max_bend={params.max_bend:.4f} rad"
            )
        own = slice(WIRES * m, WIRES * (m + 1))
        worst = float(np.abs(nearest - L)[own].max())
        if not worst <= tolerance:
            raise ValueError(
                f"module {m + 1}: no posture has its wire lengths "
                f"{np.round(1e3 * L[own], 3).tolist()} mm, they disagree by "
                f"{1e3 * worst:.3f} mm; nearest "
                f"{np.round(1e3 * nearest[own], 3).tolist()} mm"
            )
    return x[1:]
