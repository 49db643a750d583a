"""Wire tension: what the wires pull to give the modules' torques."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from plants.snake.parameters import SnakeParams
from plants.snake.snake import NEAR_ANGLES, POSITIONS
from plants.snake.tension import tensions
from systems.common.block import Block
from systems.common.parameter import check, parameter


@dataclass
class WireTensionParams:
    """Parameters of `WireTension`."""

    least: float = parameter(
        1.0, "tension of the slackest wire of each module", "N", least=0.0, most=50.0
    )


class WireTension(Block):
    """Wire tensions behind the plant's net actuation, none below a minimum.

    A module's three wires give its two torques and one pretension. (In Drake 1.58
    reaction forces and accelerations are not to be had in continuous time while
    couplers are there; the net actuation is.)

    Port ``state`` accepts the plant's positions, then velocities, of the snake [m,
    rad, m/s, rad/s] (26).

    Port ``net_actuation`` accepts the force on the translation [N] and the torques
    on a1, b1, ..., b3 [Nm] (7).

    Port ``tension`` emits the tension of wires 0 to 8 [N] (9).
    """

    def __init__(
        self, params: WireTensionParams | None = None, snake: SnakeParams | None = None
    ) -> None:
        """Makes the block."""
        super().__init__()
        self._params = check(params or WireTensionParams())
        self._snake = check(snake or SnakeParams())
        self._state = self.vector_in("state", [0.0] * (2 * POSITIONS))
        self._actuation = self.vector_in("net_actuation", [0.0] * 7)
        self.vector_out(
            "tension",
            9,
            self._calc_tension,
            {self._state.ticket(), self._actuation.ticket()},
        )

    def _calc_tension(self, context: Any) -> Sequence[float]:
        ab = self._state.Eval(context)[NEAR_ANGLES]
        tau = self._actuation.Eval(context)[1:]
        return tensions(ab, tau, self._snake, self._params.least).tolist()
