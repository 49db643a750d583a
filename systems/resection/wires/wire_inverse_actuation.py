"""Wire inverse actuation: the drums' positions for a posture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import wire_lengths
from plants.snake.core import SnakeCoreParams, torques_against_core
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import REST, Drums, Posture
from plants.snake.tension import tensions
from plants.snake.weight import GRAVITY, weight
from systems.common.block import Block
from systems.common.parameter import check, parameter

PAPERS = SnakeCoreParams(kind="coupled")
"""The core of the paper's snake."""


@dataclass
class WireInverseActuationParams:
    """Parameters of `WireInverseActuation`."""

    period: float = parameter(0.02, "of the postures", "s", least=1e-3, most=0.1)
    # Wires are wound shorter by what they stretch.
    stiffness: float = parameter(
        0.0,
        "of one wire; 0 for drums whose servos give way instead",
        "N/m",
        least=0.0,
        most=1e6,
    )
    least_tension: float = parameter(
        2.0, "of the pretension in each module", "N", least=0.0, most=50.0
    )
    gravity: list[float] = parameter(
        list(GRAVITY),
        "in W, whose sag is made up for; zeros to let the snake sag",
        "m/s2",
        least=-20.0,
        most=20.0,
        shape=(3,),
    )


def wound_lengths(
    x: ArrayLike,
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
    core: SnakeCoreParams = PAPERS,
) -> np.ndarray:
    """Drum positions of a posture x (7): wires 0 to 8 and the translation [m] (10).

    They hold the snake's weight as well, and bend its core: what gives way under it,
    wires or servos, is wound shorter by as much.
    """
    x = np.asarray(x, float)
    load = weight(x, snake, drive, params.gravity)
    stiffness = np.array([drive.travel_kp] + [drive.kp] * (len(x) - 1))
    lifted = x - load / stiffness
    if params.stiffness > 0.0:
        tau = torques_against_core(x[1:], core) - load[1:]
        T = tensions(x[1:], tau, snake, params.least_tension)
        return np.append(wire_lengths(x, snake) - T / params.stiffness, lifted[0])
    return np.append(wire_lengths(lifted, snake), lifted[0])


class WireInverseActuation(Block):
    """Wire lengths for a posture, equations (2) and (3), distal wires included.

    The posture is the one that the snake takes under its own weight. One that is no
    numbers leaves the drums where they are.

    Port ``posture`` accepts the `Posture`.
    Port ``drums`` emits the `Drums`.
    """

    def __init__(
        self,
        params: WireInverseActuationParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        posture: ArrayLike = REST,
        core: SnakeCoreParams = PAPERS,
    ) -> None:
        """Makes the block for a snake, its drive and core, starting at a posture."""
        super().__init__()
        self._params = check(params or WireInverseActuationParams())
        self._snake = check(snake or SnakeParams())
        self._drive = check(drive or SnakeDriveParams())
        self._core = core
        self._posture = self.signal_in("posture", Posture)
        self.DeclareDiscreteState(self._wound(posture))  # the last good drums
        tickets = {self._posture.ticket(), self.xd_ticket()}
        self._drums = self.cached("drums", self._calc_drums, tickets)
        self.signal_out("drums", Drums, self._drums.Eval, {self._drums.ticket()})
        self.update_every(self._params.period, self._drums.Eval)

    def _wound(self, x: ArrayLike) -> np.ndarray:
        return wound_lengths(x, self._params, self._snake, self._drive, self._core)

    def _calc_drums(self, context: Any) -> np.ndarray:
        x = self._posture.Eval(context)
        if np.isfinite(x).all():
            return self._wound(x)
        return np.array(context.get_discrete_state(0).value())
