"""Analytic Jacobians of the tool, as sums of screws.

A module turns about two ball centres, B1 and B2. With z, u, v the axes before it,
between its balls and after it, the paper's parameters turn it by

    d/dalpha:  z - u about B1,  u - v about B2        d/dbeta:  y_alpha about both

with y_alpha the bending axis; alpha's column vanishes at beta = 0. The universal
angles (a, b) of `kinematics.to_universal` do without that singularity:

    d/da:  x before about B1, x after about B2        d/db:  y between about both
"""

from collections.abc import Sequence

import numpy as np

from plants.snake.kinematics import Array, frames, to_universal
from plants.snake.parameters import SnakeParams


def _screws(q: Sequence[float] | Array, params: SnakeParams) -> list[list[Array]]:
    """Per module: R before, between (torsion-free) and after, and B1, B2, in W."""
    chain = frames(q, params)
    rows = []
    for k in range(3):
        R, B1 = chain[k][:3, :3], chain[k][:3, 3]
        after = chain[k + 1][:3, :3]
        alpha, beta = q[1 + 2 * k], q[2 + 2 * k]
        ca, sa, sb = np.cos(alpha), np.sin(alpha), np.sin(beta)
        u = R @ np.array([ca * sb, sa * sb, np.cos(beta)])
        rows.append([R, u, after, B1, B1 + 2 * params.half_pitch * u])
    return rows


def _assemble(
    columns: list[list[tuple[Array, Array]]], p_WT: Array, z_W: Array
) -> Array:
    """Spatial Jacobian (6, 7) from (axis, point) pairs by column."""
    J = np.zeros((6, 7))
    J[3:, 0] = z_W
    for i, pairs in enumerate(columns):
        for axis, point in pairs:
            J[:3, 1 + i] += axis
            J[3:, 1 + i] += np.cross(axis, p_WT - point)
    return J


def jacobian(q: Sequence[float] | Array, params: SnakeParams) -> Array:
    """V_WT = J qdot for a posture q (7,) in the paper's parameters.

    Returns:
        J (6, 7): rows w_WT then v_WT in W, as Drake orders them. The columns of
        alpha are zero where beta = 0.
    """
    columns = []
    for k, (R, u, after, B1, B2) in enumerate(_screws(q, params)):
        alpha = q[1 + 2 * k]
        y_alpha = R @ np.array([-np.sin(alpha), np.cos(alpha), 0.0])
        columns.append([(R[:, 2] - u, B1), (u - after[:, 2], B2)])
        columns.append([(y_alpha, B1), (y_alpha, B2)])
    last = frames(q, params)[3]
    p_WT = last[:3, 3] + params.tool_offset * last[:3, 2]
    return _assemble(columns, p_WT, np.array([0.0, 0.0, 1.0]))


def universal_jacobian(q: Sequence[float] | Array, params: SnakeParams) -> Array:
    """V_WT = J (sdot, adot1, bdot1, ..., bdot3) for a posture q (7,).

    Returns:
        J (6, 7), as `jacobian`, but regular at beta = 0.
    """
    columns = []
    for k, (R, _, after, B1, B2) in enumerate(_screws(q, params)):
        a, _ = to_universal(q[1 + 2 * k], q[2 + 2 * k])
        y_between = R @ np.array([0.0, np.cos(a), np.sin(a)])
        columns.append([(R[:, 0], B1), (after[:, 0], B2)])
        columns.append([(y_between, B1), (y_between, B2)])
    last = frames(q, params)[3]
    p_WT = last[:3, 3] + params.tool_offset * last[:3, 2]
    return _assemble(columns, p_WT, np.array([0.0, 0.0, 1.0]))
