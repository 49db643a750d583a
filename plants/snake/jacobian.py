"""Analytic Jacobian of the tool, as a sum of screws.

A module turns about two ball centres, B1 and B2:

    d/da:  x before about B1, x after about B2        d/db:  y between about both

It is regular where the paper's parameters are not, at beta = 0.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.kinematics import POINTS, Array, corners, turned
from plants.snake.parameters import MODULES, SnakeParams
from systems.common.compiled import compiled
from systems.common.geometry import cross, plus


@compiled
def screws(x: Any, h: float, tool: float, J: Any) -> None:
    """As `jacobian`, into J (6, 7); h is half the pitch, tool the tool's offset."""
    c = np.empty((POINTS, 3))
    corners(x, h, tool, c)
    J[:] = 0.0
    J[5, 0] = 1.0
    e, f, n = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for k in range(MODULES):
        a, b = x[1 + 2 * k], x[2 + 2 * k]
        before = e
        f, n = turned(f, n, math.cos(a), math.sin(a))
        e, n = turned(e, n, math.cos(2 * b), -math.sin(2 * b))
        arms = (
            (c[7, 0] - c[2 * k, 0], c[7, 1] - c[2 * k, 1], c[7, 2] - c[2 * k, 2]),
            (
                c[7, 0] - c[2 * k + 1, 0],
                c[7, 1] - c[2 * k + 1, 1],
                c[7, 2] - c[2 * k + 1, 2],
            ),
        )
        for i, near, far in ((1 + 2 * k, before, e), (2 + 2 * k, f, f)):
            w, v = plus(near, far), plus(cross(near, arms[0]), cross(far, arms[1]))
            for r in range(3):
                J[r, i], J[3 + r, i] = w[r], v[r]
        f, n = turned(f, n, math.cos(a), math.sin(a))


def jacobian(x: ArrayLike, params: SnakeParams) -> Array:
    """V_WT = J (sdot, adot1, bdot1, ..., bdot3) for a posture x (7,).

    Returns:
        J (6, 7): rows w_WT then v_WT in W, as Drake orders them.
    """
    J = np.empty((6, 7))
    screws(np.asarray(x, float), params.half_pitch, params.tool_offset, J)
    return J
