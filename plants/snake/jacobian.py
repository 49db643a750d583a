"""Analytic Jacobian of the tool, as a sum of screws.

A module turns about two ball centres, B1 and B2:

    d/da:  x before about B1, x after about B2        d/db:  y between about both

It is regular where the paper's parameters are not, at beta = 0.
"""

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.kinematics import Array, centreline, frames
from plants.snake.parameters import SnakeParams


def jacobian(x: ArrayLike, params: SnakeParams) -> Array:
    """V_WT = J (sdot, adot1, bdot1, ..., bdot3) for a posture x (7,).

    Returns:
        J (6, 7): rows w_WT then v_WT in W, as Drake orders them.
    """
    x = np.asarray(x, float)
    points, chain = centreline(x, params), frames(x, params)
    J = np.zeros((6, 7))
    J[5, 0] = 1.0
    for k in range(3):
        a = x[1 + 2 * k]
        y_between = chain[k][:3, :3] @ np.array([0.0, np.cos(a), np.sin(a)])
        turns = ((chain[k][:3, 0], chain[k + 1][:3, 0]), (y_between, y_between))
        for i, axes in enumerate(turns, 1 + 2 * k):
            for axis, B in zip(axes, points[2 * k : 2 * k + 2], strict=True):
                J[:3, i] += axis
                J[3:, i] += np.cross(axis, points[7] - B)
    return J
