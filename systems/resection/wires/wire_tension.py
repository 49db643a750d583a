"""Wire tension: what the wires pull to give the modules' torques."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.actuation import norm_rows
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.signals import Numbers, SnakeState, Tensions
from plants.snake.snake import NEAR_ANGLES
from plants.snake.tension import tensions_of
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field
from systems.common.step_block import StepBlock


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


@compiled
def _tension(c: Any, state: SnakeState, actuation: NetActuation) -> tuple[Tensions]:
    T: Any = np.empty(WIRES * MODULES)
    ab, tau = np.array(state.q)[NEAR_ANGLES], np.array(actuation.tau)
    R, h, e = c.ball_radius, c.half_pitch, c.plate_thickness
    tensions_of(ab, tau, c.rows, R, h, e, c.least, T)
    return (Tensions(T),)


class WireTension(StepBlock):
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
        snake = check(snake or SnakeParams())
        constants = packed(
            check(params or WireTensionParams()),
            rows=norm_rows(snake),
            ball_radius=snake.ball_radius,
            half_pitch=snake.half_pitch,
            plate_thickness=snake.plate_thickness,
        )
        self.declare_map(
            _tension,
            [constants],
            {"state": SnakeState, "net_actuation": NetActuation},
            "tension",
            Tensions,
        )
