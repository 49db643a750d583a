"""Wire inverse actuation: the drums' positions for a posture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.actuation import wire_lengths
from plants.snake.parameters import SnakeParams
from plants.snake.tension import tensions
from systems.common.block import Block
from systems.resection.resection_ik import universal


@dataclass
class WireInverseActuationParams:
    """Parameters of `WireInverseActuation`.

    Attributes:
        stiffness: Of one wire in N/m: wires are wound shorter by what they
            stretch. 0 for wires that do not stretch.
        least_tension: Of the pretension in each module, in N.
    """

    stiffness: float = 0.0
    least_tension: float = 2.0

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        for name, value in vars(self).items():
            if not value >= 0.0:
                raise ValueError(
                    f"wire_inverse_actuation.{name}={value}: expected >= 0"
                )


def wound_lengths(
    posture: Sequence[float] | np.ndarray,
    params: WireInverseActuationParams,
    snake: SnakeParams,
) -> list[float]:
    """Drum positions of a posture (7): wires 0 to 8 and the translation [m] (10)."""
    q = np.asarray(posture, float)
    L = wire_lengths(q, snake)
    if params.stiffness > 0.0:
        ab = universal(q.tolist())[1:]
        T = tensions(ab, np.zeros(6), snake, params.least_tension)
        L = L - T / params.stiffness
    return [*L.tolist(), float(q[0])]


class WireInverseActuation(Block):
    """Wire lengths for a posture, equations (2) and (3), distal wires included.

    Port ``posture`` accepts s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7).

    Port ``drums`` emits the lengths of wires 0 to 8 and the translation s [m] (10).
    """

    def __init__(
        self,
        params: WireInverseActuationParams | None = None,
        snake: SnakeParams | None = None,
    ) -> None:
        """Makes the block."""
        super().__init__()
        self._params = params or WireInverseActuationParams()
        self._params.check()
        self._snake = (snake or SnakeParams()).check()
        self._posture = self.vector_in("posture", [0.0, 0.3, 0.2, 1.0, 0.4, 2.0, 0.1])
        self.vector_out("drums", 10, self._calc_drums, {self._posture.ticket()})

    def _calc_drums(self, context: Any) -> Sequence[float]:
        return wound_lengths(self._posture.Eval(context), self._params, self._snake)
