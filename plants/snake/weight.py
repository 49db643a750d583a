"""The snake's own weight, as forces on its coordinates."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import MODULES, SnakeParams
from systems.common.compiled import compiled

BALLS = 2 * MODULES
GRAVITY = (0.0, 0.0, -9.81)
"""In W, in m/s2; the channel points up in the plant's world."""


@compiled
def torques_of_weight(
    x: Any, h: float, tool: float, ball: float, plate: float, ring: float, g: Any
) -> Any:
    """Generalised forces of gravity on a1, b1, ..., b3 (6,) in Nm (compiled)."""
    centre = np.empty((BALLS + 1, 3))
    first, second = np.empty((BALLS, 3)), np.empty((BALLS, 3))
    p = np.zeros(3)
    e, f, n = np.array([1.0, 0, 0]), np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
    for i in range(BALLS):
        a, b = x[1 + 2 * (i // 2)], x[2 + 2 * (i // 2)]
        ca, sa, cb, sb = math.cos(a), math.sin(a), math.cos(b), math.sin(b)
        centre[i] = p
        for turn in range(2):
            if turn == i % 2:  # Rx(a): the first turn of a near ball
                first[i] = e
                f, n = ca * f + sa * n, ca * n - sa * f
            else:
                second[i] = f
                e, n = cb * e - sb * n, cb * n + sb * e
        p = p + 2 * h * n
    centre[BALLS] = p
    out = np.zeros(2 * MODULES)
    # From the tip inwards: the mass beyond each ball and its moment about W.
    mass, moment = ring, ring * (p + tool * n)
    for i in range(BALLS - 1, -1, -1):
        mass += plate
        moment = moment + plate * (centre[i] + centre[i + 1]) / 2
        force = np.cross(moment - mass * centre[i], g)
        out[2 * (i // 2)] += np.dot(first[i], force)
        out[2 * (i // 2) + 1] += np.dot(second[i], force)
        mass += ball
        moment = moment + ball * centre[i]
    return out


def whole_mass(drive: SnakeDriveParams) -> float:
    """Of all that the translation moves, in kg."""
    balls = BALLS * (drive.ball_mass + drive.plate_mass)
    return drive.carriage_mass + balls + drive.tool_mass


def weight(
    x: Sequence[float] | NDArray[np.float64],
    params: SnakeParams,
    drive: SnakeDriveParams,
    gravity: Sequence[float] = GRAVITY,
) -> NDArray[np.float64]:
    """Generalised forces of gravity on (s, a1, b1, ..., b3).

    Args:
        x: Posture as s, a1, b1, ..., b3, (7,).
        params: Geometry.
        drive: Masses.
        gravity: Acceleration in W in m/s2, (3,).

    Returns:
        Force in N, then torques in Nm, (7,).
    """
    d, g = drive, np.asarray(gravity, float)
    torques = torques_of_weight(
        np.asarray(x, float),
        params.half_pitch,
        params.tool_offset,
        d.ball_mass,
        d.plate_mass,
        d.tool_mass,
        g,
    )
    return np.concatenate([[whole_mass(d) * g[2]], torques])
