"""Wire tension: what the wires pull to give the modules' torques."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.signals import Numbers, SnakeState, Tensions
from plants.snake.snake import NEAR_ANGLES
from plants.snake.tension import tensions
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field, view


class NetActuation(NamedTuple):
    """What the plant's servos exert."""

    travel: Annotated[float, Field("N", "force on the translation", 0.0)]
    tau: Annotated[
        Numbers, Field("N m", "torques on a1, b1, ..., b3", (0.0,) * (2 * MODULES))
    ]


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

    Port ``state`` accepts the plant's `SnakeState`.
    Port ``net_actuation`` accepts the `NetActuation`.
    Port ``tension`` emits the `Tensions`.
    """

    def __init__(
        self, params: WireTensionParams | None = None, snake: SnakeParams | None = None
    ) -> None:
        """Makes the block."""
        super().__init__()
        self._params = check(params or WireTensionParams())
        self._snake = check(snake or SnakeParams())
        self._state = self.signal_in("state", SnakeState)
        self._actuation = self.signal_in("net_actuation", NetActuation)
        tickets = {self._state.ticket(), self._actuation.ticket()}
        self.signal_out("tension", Tensions, self._calc_tension, tickets)

    def _calc_tension(self, context: Any) -> np.ndarray:
        ab = view(SnakeState, self._state.Eval(context)).q[NEAR_ANGLES]
        tau = view(NetActuation, self._actuation.Eval(context)).tau
        return tensions(ab, tau, self._snake, self._params.least)
