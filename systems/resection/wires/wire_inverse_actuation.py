"""Wire inverse actuation: the drums' positions for a posture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.actuation import wire_lengths
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.tension import tensions
from plants.snake.weight import GRAVITY, weight
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.resection.wires.resection_ik import from_universal, universal


@dataclass
class WireInverseActuationParams:
    """Parameters of `WireInverseActuation`."""

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
    posture: Sequence[float] | np.ndarray,
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
) -> list[float]:
    """Drum positions of a posture (7): wires 0 to 8 and the translation [m] (10).

    They hold the snake's weight as well: what gives way under it, wires or servos,
    is wound shorter by as much.
    """
    x = universal(np.asarray(posture, float).tolist())
    load = weight(x, snake, drive, params.gravity)
    s = x[0] - float(load[0]) / drive.travel_kp
    if params.stiffness > 0.0:
        L = wire_lengths(np.asarray(posture, float), snake)
        T = tensions(x[1:], -load[1:], snake, params.least_tension)
        return [*(L - T / params.stiffness).tolist(), s]
    ab = (np.array(x[1:]) - load[1:] / drive.kp).tolist()
    return [*wire_lengths(from_universal([s, *ab]), snake).tolist(), s]


class WireInverseActuation(Block):
    """Wire lengths for a posture, equations (2) and (3), distal wires included.

    The posture is the one that the snake takes under its own weight.

    Port ``posture`` accepts s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7).

    Port ``drums`` emits the lengths of wires 0 to 8 and the translation s [m] (10).
    """

    def __init__(
        self,
        params: WireInverseActuationParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
    ) -> None:
        """Makes the block for a snake and its drive."""
        super().__init__()
        self._params = check(params or WireInverseActuationParams())
        self._snake = check(snake or SnakeParams())
        self._drive = check(drive or SnakeDriveParams())
        self._posture = self.vector_in("posture", [0.0, 0.3, 0.2, 1.0, 0.4, 2.0, 0.1])
        self.vector_out("drums", 10, self._calc_drums, {self._posture.ticket()})

    def _calc_drums(self, context: Any) -> Sequence[float]:
        posture = self._posture.Eval(context)
        return wound_lengths(posture, self._params, self._snake, self._drive)
