"""Inverse kinematics: positioning part, whole robot, last module, entry (paper, V).

The positioning part (translation, modules 1 and 2) takes the intermediate frame I,
which stands at O2, to a position p_WI with its axis along n_WI; its roll follows.
With v the axis between the two modules,

    p_WI = (0, 0, s) + 2h [ (z + v)/|z + v| + v + (v + n)/|v + n| + n ].

Given k = cos(beta2), the lateral part is a vector equation along the azimuth of
module 1 and gives alpha1 and beta1, hence v; what is left is one equation in k,
v . n = 2 k^2 - 1, with exactly one root within the limits: the paper's "unique
solution of the intermediate inverse kinematics" (V.B.2).

The whole robot has two freedoms more than a tool axis and position need. They are
taken as the intermediate axis n_WI itself, from which all else follows.
"""

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plants.snake.inverse_kernels import (
    REACHED,
    solve_positionings,
    solve_tool,
    solve_tools,
)
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array
from systems.common.signal import vector


def vectors(name: str, value: ArrayLike, unit: bool = False) -> Array:
    """Checks 3-vectors (..., 3) and returns them contiguous; axes made unit.

    Raises:
        ValueError: If the shape is wrong, a number is not finite or an axis zero.
    """
    value = np.asarray(value, float)
    if value.ndim == 0 or value.shape[-1] != 3:
        raise ValueError(f"{name} has shape {value.shape}, expected (..., 3)")
    if not np.isfinite(value).all():
        raise ValueError(f"{name} holds numbers that are not finite")
    if unit:
        norm = np.sqrt(np.einsum("...i,...i", value, value))[..., None]
        if not (norm > 0).all():
            raise ValueError(f"{name} holds a zero vector: an axis has a direction")
        value = value / norm
    return np.ascontiguousarray(value)


@dataclass
class Solutions:
    """Answers of the inverse kinematics.

    Attributes:
        x: Postures, (..., 5) or (..., 7): s, a1, b1, ... NaN if the bends do not
            reach; if only the translation falls short, the posture that its travel
            forbids.
        status: REACHED, or the limit in the way (`inverse_kernels`), (...) of int.
    """

    x: Array
    status: NDArray[np.int64]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether each pose is reached, (...)."""
        return self.status == REACHED


def positioning(p_WI: ArrayLike, n_WI: ArrayLike, params: SnakeParams) -> Solutions:
    """Postures of the positioning part for intermediate poses (paper, V.B.2).

    Args:
        p_WI: Positions of O2 in m, (..., 3).
        n_WI: Axes there, any length, (..., 3).
        params: The snake.

    Returns:
        Postures (..., 5). For why a pose is refused ask `reachability.refusal`.
    """
    p, n = np.broadcast_arrays(vectors("p_WI", p_WI), vectors("n_WI", n_WI, unit=True))
    x = np.empty((*p.shape[:-1], 5))
    status = np.empty(p.shape[:-1], np.int64)
    solve_positionings(
        np.ascontiguousarray(p).reshape(-1, 3),
        np.ascontiguousarray(n).reshape(-1, 3),
        params.half_pitch,
        params.max_bend,
        (params.travel[0], params.travel[1]),
        x.reshape(-1, 5),
        status.reshape(-1),
    )
    return Solutions(x, status)


def tool_postures(
    p_WT: ArrayLike, n_WT: ArrayLike, n_WI: ArrayLike, params: SnakeParams
) -> Solutions:
    """Postures of the whole robot for a tool position and axis.

    Args:
        p_WT: Positions of the tool in m, (..., 3).
        n_WT: Its axes, (..., 3).
        n_WI: Intermediate axes, (..., 3): the two redundant freedoms. Equal to
            n_WT, the last module is straight.
        params: The snake.

    Returns:
        Postures (..., 7).
    """
    p, n, m = np.broadcast_arrays(
        vectors("p_WT", p_WT),
        vectors("n_WT", n_WT, unit=True),
        vectors("n_WI", n_WI, unit=True),
    )
    x = np.empty((*p.shape[:-1], 7))
    status = np.empty(p.shape[:-1], np.int64)
    solve_tools(
        np.ascontiguousarray(p).reshape(-1, 3),
        np.ascontiguousarray(n).reshape(-1, 3),
        np.ascontiguousarray(m).reshape(-1, 3),
        params.half_pitch,
        params.tool_offset,
        params.max_bend,
        (params.travel[0], params.travel[1]),
        x.reshape(-1, 7),
        status.reshape(-1),
    )
    return Solutions(x, status)


def tool_posture(target: ArrayLike, params: SnakeParams) -> tuple[list[float], int]:
    """One posture of the whole robot, for use in a control step.

    Args:
        target: p_WT in m, n_WT, n_WI, (9,), as for `tool_postures`.
        params: The snake.

    Returns:
        The posture (7) and its status.

    Raises:
        ValueError: If a number is not finite or an axis zero.
    """
    p, n, m = np.array(target, float).reshape(3, 3)
    if not math.isfinite(math.hypot(*p, *n, *m)):
        raise ValueError(f"target={target!r} holds numbers that are not finite")
    for axis in (n, m):
        size = math.hypot(*axis)
        if size == 0.0:
            raise ValueError(f"target={target!r} holds a zero vector as an axis")
        axis /= size
    x = np.empty(7)
    h, tool, bend = params.half_pitch, params.tool_offset, params.max_bend
    travel = (params.travel[0], params.travel[1])
    status = solve_tool(vector(p), vector(n), vector(m), h, tool, bend, travel, x)
    return x.tolist(), status
