"""Wire forward actuation: what posture the wires' lengths impose."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from plants.snake.actuation import Bends, bends_of_lengths, wire_lengths
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from systems.common.block import Block
from systems.common.parameter import check
from systems.resection.wires.resection_ik import universal


class WireForwardActuation(Block):
    """Bends from wire lengths, module after module (paper, IV.B.2 and IV.C).

    The plant's springs stand for wires and drums; their set-point is the posture
    that the lengths impose, taken ahead by the time that damping lags and that the
    integrator holds it.

    Port ``lengths`` accepts wires 0 to 8 and the translation [m] (10).

    Port ``rates`` accepts their time derivatives [m/s] (10).

    Port ``posture`` emits s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7).

    Port ``residual`` emits how far each module's three wires disagree, as
    |x|^2 - 1 of `plants.snake.actuation` (3).

    Port ``desired_state`` emits the set-point of the plant's servos: s [m], a1, b1,
    ..., b3 [rad], then seven zeros (14).
    """

    def __init__(
        self,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        hold: float = 0.0,
    ) -> None:
        """Makes the block for a snake and its drive.

        Args:
            snake: Geometry.
            drive: Masses and gains.
            hold: The integrator's step in s: CENIC takes set-points as they are at
                a step's start, and brings the joints there by its end.
        """
        super().__init__()
        self._snake = check(snake or SnakeParams())
        self._drive = check(drive or SnakeDriveParams())
        self._lead = self._drive.lead + hold
        self._travel_lead = self._drive.travel_lead + hold
        straight = [*wire_lengths(np.zeros(7), self._snake).tolist(), 0.0]
        self._lengths = self.vector_in("lengths", straight)
        self._rates = self.vector_in("rates", [0.0] * 10)
        self._bends = self.cached("bends", self._calc_bends, {self._lengths.ticket()})
        now = {self._lengths.ticket(), self._bends.ticket()}
        both = {self._lengths.ticket(), self._rates.ticket()}
        self.vector_out("posture", 7, self._calc_posture, now)
        self.vector_out("residual", 3, self._calc_residual, now)
        self.vector_out("desired_state", 14, self._calc_desired_state, both)

    def _calc_posture(self, context: Any) -> Sequence[float]:
        s = float(self._lengths.Eval(context)[9])
        return [s, *self._bends.Eval(context).q.tolist()]

    def _calc_bends(self, context: Any) -> Bends:
        return bends_of_lengths(self._lengths.Eval(context)[:9], self._snake)

    def _calc_residual(self, context: Any) -> Sequence[float]:
        return self._bends.Eval(context).residual.tolist()

    def _calc_desired_state(self, context: Any) -> Sequence[float]:
        lengths, rates = self._lengths.Eval(context), self._rates.Eval(context)
        ahead = lengths[:9] + self._lead * rates[:9]
        s = float(lengths[9] + self._travel_lead * rates[9])
        bends = bends_of_lengths(ahead, self._snake)
        return [*universal([s, *bends.q.tolist()]), *[0.0] * 7]
