"""Wire drums: nine motors that wind wires, and the one that slides the robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.actuation import length_range, wire_lengths
from plants.snake.parameters import SnakeParams
from systems.common.block import Block
from systems.common.parameter import check, parameter

AXES = 10
"""Nine drums and the translation."""


@dataclass
class WireDrumsParams:
    """Parameters of `WireDrums`."""

    period: float = parameter(
        0.02, "of the motors' position control", "s", least=1e-3, most=0.1
    )
    wire_rate: float = parameter(
        0.05, "largest speed of a wire", "m/s", least=1e-3, most=1.0
    )
    travel_rate: float = parameter(
        0.04, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )
    margin: float = parameter(
        1.0e-3,
        "stroke beyond what postures need, for pretension",
        "m",
        above=0.0,
        most=0.01,
    )


class WireDrums(Block):
    """Position-controlled drums with rate and stroke limits.

    A command is reached at the end of the period in which it is given, every motor
    turning at a constant rate meanwhile. If one motor is too slow for that, all are
    slowed by the same share, so that the wires keep matching each other. While
    ``stop`` is not zero, or a command is not finite, all stand still.

    Port ``command`` accepts the lengths of wires 0 to 8 and the translation, to be
    reached one period later [m] (10).

    Port ``stop`` accepts 0, or anything else to stop (1).

    Port ``lengths`` emits what is wound out at this instant [m] (10).

    Port ``rates`` emits its time derivative [m/s] (10).

    Port ``limited`` emits 0, 1 if a rate limit slows the motion, 2 if a command is
    beyond a stroke and was cut (1).
    """

    def __init__(
        self,
        params: WireDrumsParams | None = None,
        snake: SnakeParams | None = None,
        lengths: Sequence[float] | None = None,
    ) -> None:
        """Makes the block, starting at `lengths` (10); straight at s = 0 if None."""
        super().__init__()
        self._params = check(params or WireDrumsParams())
        snake = check(snake or SnakeParams())
        low, high = length_range(snake)
        margin = self._params.margin
        self._low = np.append(low - margin, snake.travel[0])
        self._high = np.append(high + margin, snake.travel[1])
        self._most = self._params.period * np.array(
            [self._params.wire_rate] * 9 + [self._params.travel_rate]
        )
        straight = [*wire_lengths(np.zeros(7), snake).tolist(), 0.0]
        start = straight if lengths is None else [*lengths]
        self._command = self.vector_in("command", straight)
        self._stop = self.vector_in("stop", [0.0])
        # The lengths at the last update, and its instant.
        self._start = self.DeclareDiscreteState([*start, 0.0])
        self._rates = self.state_out("rates", [0.0] * AXES)
        self.state_out("limited", [0.0])
        self.vector_out(
            "lengths", AXES, self._calc_lengths, {self.xd_ticket(), self.time_ticket()}
        )
        self.update_every(self._params.period, self._update)

    def _calc_lengths(self, context: Any) -> Sequence[float]:
        start = context.get_discrete_state(self._start).value()
        rates = context.get_discrete_state(self._rates).value()
        elapsed = min(context.get_time() - float(start[AXES]), self._params.period)
        return (start[:AXES] + elapsed * rates).tolist()

    def _update(self, context: Any) -> Sequence[Sequence[float]]:
        now = np.array(self._calc_lengths(context))
        time, period = context.get_time(), self._params.period
        command = self._command.Eval(context)
        if self._stop.Eval(context)[0] != 0.0 or not np.isfinite(command).all():
            return [*now, time], [0.0] * AXES, [0.0]
        goal = np.minimum(np.maximum(command, self._low), self._high)
        step = goal - now
        slow = float((np.abs(step) / self._most).max())
        limited = 2.0 if (goal != command).any() else 1.0 if slow > 1.0 + 1e-9 else 0.0
        rates = step / (period * max(slow, 1.0))
        return [*now, time], rates.tolist(), [limited]
