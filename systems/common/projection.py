"""The velocity nearest to a wanted one that keeps a handful of constraints.

Half-spaces, a ball of speed, and a cylinder of turning speed: a small convex program in
three unknowns. Dykstra's algorithm solves it by projecting on one set after the other;
unlike projecting in turn alone it ends at the *nearest* feasible point. Where the sets
have no point in common it ends between them, the speeds being kept.
"""

from math import sqrt

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import (
    across,
    along,
    dot,
    limited,
    norm,
    plus,
    row_of,
    scaled,
    set_row,
    sub,
)
from systems.common.signal import Vector

TOLERANCE = 1e-7
"""Of a velocity, m/s."""
MOST_ROUNDS = 200
_LITTLE = 1e-4
"""What slow convergence leaves, m/s: less than this is no contradiction."""


@compiled
def onto_limits(v: Vector, u: Vector, speed: float, turning: float) -> Vector:
    """The nearest velocity of at most `speed`, and of at most `turning` across u.

    Exact: in the half plane of u and v it is the nearest point of a disc cut by a line.
    """
    lengthwise = dot(v, u)
    sideways = across(v, u)
    side = norm(sideways)
    if side <= turning and lengthwise * lengthwise + side * side <= speed * speed:
        return v
    most = min(turning, speed)
    # On the disc, else on the cylinder, else at the corner of both.
    size = sqrt(lengthwise * lengthwise + side * side)
    if side * speed <= most * size and size > speed:
        return limited(v, speed)
    corner = sqrt(max(0.0, speed * speed - most * most))
    kept = max(-corner, min(corner, lengthwise))
    if side < 1e-12:
        return scaled(kept, u)
    return along(scaled(most / side, sideways), kept, u)


@compiled
def most_missed(v: Vector, rows: np.ndarray, bounds: np.ndarray) -> float:
    """By how much v misses the row it misses most, m/s; 0 if none."""
    missed = 0.0
    for i in range(len(bounds)):
        missed = max(missed, bounds[i] - dot(row_of(rows, i), v))
    return missed


@compiled
def nearest_velocity(
    wanted: Vector,
    rows: np.ndarray,
    bounds: np.ndarray,
    u: Vector,
    speed: float,
    turning: float,
) -> tuple[Vector, float]:
    """The velocity nearest to `wanted` that keeps rows v >= bounds and the speeds.

    Args:
        wanted: In m/s.
        rows: Normals (n, 3), of any length.
        bounds: In m/s (n).
        u: Unit vector along the shaft.
        speed: Greatest speed, m/s.
        turning: Greatest speed across u, m/s.

    Returns:
        The velocity, and by how much the worst row is missed, m/s; 0 within tolerance
        where there is a solution.
    """
    count = len(bounds)
    corrections = np.zeros((count, 3))
    squares = np.empty(count)
    for i in range(count):
        squares[i] = dot(row_of(rows, i), row_of(rows, i))
    last = (0.0, 0.0, 0.0)
    v = wanted
    for _ in range(MOST_ROUNDS):
        before = v
        between, active = (0.0, 0.0, 0.0), 0
        for i in range(count):
            if squares[i] < 1e-12:
                continue
            row, shifted = row_of(rows, i), plus(v, row_of(corrections, i))
            short = bounds[i] - dot(row, shifted)
            v = along(shifted, max(0.0, short) / squares[i], row)
            set_row(corrections, i, sub(shifted, v))
            if short > 0.0:
                between, active = plus(between, v), active + 1
        shifted = plus(v, last)
        v = onto_limits(shifted, u, speed, turning)
        last = sub(shifted, v)
        missed = most_missed(v, rows, bounds)
        if missed < TOLERANCE and norm(sub(v, before)) < TOLERANCE:
            return v, 0.0
    if missed < _LITTLE or active < 2:
        return v, missed
    # Rows against each other: as much of one as of the other is given up.
    v = onto_limits(scaled(1.0 / active, between), u, speed, turning)
    return v, most_missed(v, rows, bounds)


@compiled
def greatest_rate(row: Vector, u: Vector, speed: float, turning: float) -> float:
    """The greatest row . v within the speeds, m/s."""
    lengthwise, side = dot(row, u), norm(across(row, u))
    size = sqrt(lengthwise * lengthwise + side * side)
    most = min(turning, speed)
    if side * speed <= most * size:
        return speed * size
    return most * side + abs(lengthwise) * sqrt(speed * speed - most * most)
