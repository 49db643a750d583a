"""Snake location: posture and tool pose from the plant's state."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array, bends_of
from plants.snake.signals import (
    MODULE_NUMBERS,
    REST,
    Numbers,
    Posture,
    SnakeState,
    ToolPose,
)
from plants.snake.snake import FAR, NEAR, NEAR_ANGLES
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import check
from systems.common.signal import Field, flat, vector, view

BEND_NAMES = [f"{name}{k}" for k in MODULE_NUMBERS for name in ("alpha", "beta")]


class Bends(NamedTuple):
    """A posture as the paper writes it."""

    q: Annotated[
        Numbers,
        Field(
            "m, rad",
            "s, alpha1, beta1, ..., alpha3, beta3",
            REST,
            ("s", *BEND_NAMES),
        ),
    ]


class CouplerError(NamedTuple):
    """How well the couplers hold."""

    angle: Annotated[
        float, Field("rad", "largest between what a module's two balls do", 0.0)
    ]


@compiled
def posture_in(state: Any) -> Array:
    """The posture (7,) in the elements of a `SnakeState`."""
    x = state[NEAR]
    x[1:] = (x[1:] + state[FAR]) / 2
    return x


class SnakeLocation(Block):
    """Where the snake truly is.

    Port ``state`` accepts the plant's `SnakeState`.
    Port ``posture`` emits the `Posture`.
    Port ``bends`` emits it as `Bends`, to be logged.
    Port ``tool`` emits the `ToolPose`.
    Port ``coupler_error`` emits the `CouplerError`.
    """

    def __init__(self, snake: SnakeParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._snake = check(snake or SnakeParams())
        self._state = self.signal_in("state", SnakeState)
        ticket = {self._state.ticket()}
        self._posture = self.cached("posture", self._calc_posture, ticket)
        known = {self._posture.ticket()}
        self.signal_out("posture", Posture, self._posture.Eval, known)
        self.signal_out("bends", Bends, self._calc_bends, known)
        self.signal_out("tool", ToolPose, self._calc_tool, known)
        self.signal_out("coupler_error", CouplerError, self._calc_coupler_error, ticket)

    def _calc_posture(self, context: Any) -> Array:
        return posture_in(self._state.Eval(context))

    def _calc_bends(self, context: Any) -> Array:
        return bends_of(self._posture.Eval(context))

    def _calc_tool(self, context: Any) -> Array:
        X_WT = forward(self._posture.Eval(context), self._snake)
        return flat(ToolPose(vector(X_WT[:3, 3]), vector(X_WT[:3, 2])))

    def _calc_coupler_error(self, context: Any) -> list[float]:
        q = view(SnakeState, self._state.Eval(context)).q
        return [float(np.abs(q[NEAR_ANGLES] - q[FAR]).max())]
