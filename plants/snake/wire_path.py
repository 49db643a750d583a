"""The wires' true path across the balls, to be drawn.

Between two plates a wire runs straight from P_i to P'_i, or, in contact, along a
tangent of length d to the ball, round it, and off it along another tangent of
length d (Figure 6). So one fixed piece from either end and one in the middle draw
every wire in every posture: the end pieces overlap where the wire is short.
"""

import math

import numpy as np

from plants.snake.actuation import norm_rows
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.posture import Array

BALLS = 2 * MODULES


def wires_at(ball: int) -> range:
    """The wires that run over a ball: those of its module and of later ones."""
    return range(WIRES * (ball // 2), WIRES * MODULES)


def hanging_points(
    turns: Array, s: float, params: SnakeParams
) -> list[tuple[Array, Array, Array]]:
    """Ball centre O, P_i and P'_i in W for each ball, in m: (3,), (n, 3), (n, 3).

    Args:
        turns: R_i of the balls, (6, 3, 3); `statics.turns_of` has the paper's.
        s: Translation in m.
        params: The snake.
    """
    h, d = params.half_pitch, params.face
    rows = norm_rows(params)
    # R (cos phi, sin phi, 0)
    circle = np.column_stack([rows[:, 1] / -2, rows[:, 2] / -2, 0 * rows[:, 0]])
    centre, plate = np.array([0.0, 0.0, s]), np.eye(3)
    found = []
    for ball, turn in enumerate(turns):
        after = plate @ turn
        own = circle[wires_at(ball).start :]
        up = np.array([0.0, 0.0, d])
        found.append(
            (centre, centre + (own - up) @ plate.T, centre + (own + up) @ after.T)
        )
        centre, plate = centre + 2 * h * after[:, 2], after
    return found


def tangent_points(
    centre: Array, P: Array, P_far: Array, params: SnakeParams
) -> tuple[Array, Array]:
    """Where wires touch a ball and leave it, B and C in W, (n, 3) each.

    Wires that hang free have both points at distance d from their ends, towards
    each other.
    """
    d, R = params.face, params.ball_radius
    along = P_far - P
    size = np.linalg.norm(along, axis=1)[:, None]
    B, C = P + d * along / size, P_far - d * along / size
    rho = math.hypot(R, d)
    a, b = (P - centre) / rho, (P_far - centre) / rho
    cosine = (a * b).sum(1)[:, None]
    sine = np.sqrt(1 - cosine**2)
    turn = math.acos(R / rho)
    across_a, across_b = (b - cosine * a) / sine, (a - cosine * b) / sine
    touching = size > 2 * d
    ct, st = R * math.cos(turn), R * math.sin(turn)
    B = np.where(touching, centre + ct * a + st * across_a, B)
    C = np.where(touching, centre + ct * b + st * across_b, C)
    return B, C
