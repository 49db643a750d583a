"""Snake location: posture and tool pose from the plant's state."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.snake import FAR, NEAR, NEAR_ANGLES, POSITIONS
from systems.common.block import Block
from systems.common.parameter import check
from systems.resection.wires.resection_ik import from_universal


class SnakeLocation(Block):
    """Where the snake truly is.

    Port ``state`` accepts the plant's positions, then velocities, of the snake [m,
    rad, m/s, rad/s] (26).

    Port ``posture`` emits s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7).

    Port ``tool`` emits p_WT [m] and the tool's axis n_WT, channel frame W (6).

    Port ``coupler_error`` emits the largest angle between what the two balls of a
    module do [rad] (1).
    """

    def __init__(self, snake: SnakeParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._snake = check(snake or SnakeParams())
        self._state = self.vector_in("state", [0.0] * (2 * POSITIONS))
        ticket = {self._state.ticket()}
        self._posture = self.cached("posture", self._calc_posture, ticket)
        known = {self._posture.ticket()}
        self.vector_out("posture", 7, self._posture.Eval, known)
        self.vector_out("tool", 6, self._calc_tool, known)
        self.vector_out("coupler_error", 1, self._calc_coupler_error, ticket)

    def _calc_posture(self, context: Any) -> Sequence[float]:
        x = self._state.Eval(context)
        near = x[NEAR]
        near[1:] = (near[1:] + x[FAR]) / 2
        return from_universal(near.tolist())

    def _calc_tool(self, context: Any) -> Sequence[float]:
        X_WT = forward(self._posture.Eval(context), self._snake)
        return [*X_WT[:3, 3].tolist(), *X_WT[:3, 2].tolist()]

    def _calc_coupler_error(self, context: Any) -> Sequence[float]:
        x = self._state.Eval(context)
        return [float(np.abs(x[NEAR_ANGLES] - x[FAR]).max())]
