"""Ball location: tool pose, mean posture and gaps from the turns of six balls."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, gaps, mean_bends, tool_pose, turns_of_angles
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array
from plants.snake.signals import (
    MODULE_NUMBERS,
    BallPosture,
    BallState,
    Numbers,
    ToolPose,
)
from systems.common.block import Block
from systems.common.parameter import check
from systems.common.signal import Field, flat, vector, view
from systems.resection.wires.snake_location import Bends


class BallAngles(NamedTuple):
    """How far each ball turns."""

    q: Annotated[
        Numbers,
        Field(
            "rad",
            "Rx, Ry, Rz a ball",
            (0.0,) * (3 * BALLS),
            tuple(f"{axis}{i}" for i in range(1, BALLS + 1) for axis in "xyz"),
        ),
    ]


class Gaps(NamedTuple):
    """What the paper takes to be zero."""

    split: Annotated[
        Numbers,
        Field(
            "rad",
            "between the bends of a module's two balls",
            (0.0,) * len(MODULE_NUMBERS),
            tuple(f"split{k}" for k in MODULE_NUMBERS),
        ),
    ]
    torsion: Annotated[
        Numbers,
        Field(
            "rad",
            "of each ball",
            (0.0,) * BALLS,
            tuple(f"torsion{i}" for i in range(1, BALLS + 1)),
        ),
    ]


class BallLocation(Block):
    """Where a snake of free balls truly is.

    Port ``state`` accepts the plant's `BallState`.
    Port ``posture`` emits the `BallPosture`.
    Port ``bends`` emits the mean bend of each module's balls, `Bends`.
    Port ``tool`` emits the `ToolPose`.
    Port ``balls`` emits their `BallAngles`.
    Port ``gaps`` emits the `Gaps`.
    """

    def __init__(self, snake: SnakeParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._snake = check(snake or SnakeParams())
        self._state = self.signal_in("state", BallState)
        ticket = {self._state.ticket()}
        self._turns = self.cached("turns", self._calc_turns, ticket)
        known = {*ticket, self._turns.ticket()}
        self.signal_out("posture", BallPosture, self._calc_posture, ticket)
        self.signal_out("bends", Bends, self._calc_bends, known)
        self.signal_out("tool", ToolPose, self._calc_tool, known)
        self.signal_out("balls", BallAngles, self._calc_balls, ticket)
        self.signal_out("gaps", Gaps, self._calc_gaps, known)

    def _calc_turns(self, context: Any) -> Array:
        return turns_of_angles(view(BallState, self._state.Eval(context)).q[1:])

    def _calc_posture(self, context: Any) -> Array:
        q: Array = view(BallState, self._state.Eval(context)).q
        return q

    def _calc_bends(self, context: Any) -> Array:
        s = view(BallState, self._state.Eval(context)).q[0]
        return np.append(s, mean_bends(self._turns.Eval(context)))

    def _calc_tool(self, context: Any) -> Array:
        s = float(view(BallState, self._state.Eval(context)).q[0])
        X_WT = tool_pose(self._turns.Eval(context), s, self._snake)
        return flat(ToolPose(vector(X_WT[:3, 3]), vector(X_WT[:3, 2])))

    def _calc_balls(self, context: Any) -> Array:
        q: Array = view(BallState, self._state.Eval(context)).q
        return q[1:]

    def _calc_gaps(self, context: Any) -> Array:
        return np.concatenate(gaps(self._turns.Eval(context)))
