"""Wire drums: nine motors that wind wires, and the one that slides the robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import length_range, wire_lengths
from plants.snake.parameters import DRUMS, MODULES, WIRES, SnakeParams
from plants.snake.signals import REST, DrumRates, Drums, Stopped
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field


class Limited(NamedTuple):
    """What limits the motors."""

    code: Annotated[float, Field("1", "0, 1 by a rate, 2 by a stroke", 0.0)]


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
    slowed by the same share, so that the wires keep matching each other; beyond a
    stroke a command is cut. While ``stop`` is not zero, or a command is not finite, all
    stand still.

    Port ``command`` accepts the `Drums` to be reached one period later.
    Port ``stop`` accepts whether they are `Stopped`.
    Port ``lengths`` emits what is wound out at this instant, `Drums`.
    Port ``rates`` emits their `DrumRates`.
    Port ``limited`` emits whether the motion is `Limited`.
    """

    def __init__(
        self,
        params: WireDrumsParams | None = None,
        snake: SnakeParams | None = None,
        lengths: ArrayLike | None = None,
    ) -> None:
        """Makes the block, starting at `lengths` (10); straight at s = 0 if None."""
        super().__init__()
        self._params = check(params or WireDrumsParams())
        snake = check(snake or SnakeParams())
        low, high = length_range(snake)
        s_min, s_max = snake.travel
        self._low = np.append(low - self._params.margin, s_min)
        self._high = np.append(high + self._params.margin, s_max)
        wires = [self._params.wire_rate] * (WIRES * MODULES)
        self._most = self._params.period * np.array([*wires, self._params.travel_rate])
        if lengths is None:
            lengths = np.append(wire_lengths(REST, snake), 0.0)
        self._command = self.signal_in("command", Drums)
        self._stop = self.signal_in("stop", Stopped)
        # The lengths at the last update, and its instant.
        self._start = self.DeclareDiscreteState(np.array(lengths, float))
        self._since = self.DeclareDiscreteState([0.0])
        self._rates = self.state_out("rates", DrumRates, np.zeros(DRUMS))
        self.state_out("limited", Limited, np.zeros(1))
        tickets = {self.xd_ticket(), self.time_ticket()}
        self.signal_out("lengths", Drums, self._calc_lengths, tickets)
        self.update_every(self._params.period, self._update)

    def _calc_lengths(self, context: Any) -> np.ndarray:
        start, (since,), rates = (
            context.get_discrete_state(group).value()
            for group in (self._start, self._since, self._rates)
        )
        elapsed = min(context.get_time() - float(since), self._params.period)
        lengths: np.ndarray = start + elapsed * rates
        return lengths

    def _update(self, context: Any) -> Sequence[Any]:
        now, command = self._calc_lengths(context), self._command.Eval(context)
        since, (stopped,) = [context.get_time()], self._stop.Eval(context)
        if stopped != 0.0 or not np.isfinite(command).all():
            return now, since, np.zeros(DRUMS), [0.0]
        goal = np.minimum(np.maximum(command, self._low), self._high)
        step = goal - now
        slow = float((np.abs(step) / self._most).max())
        limited = 2.0 if (goal != command).any() else 1.0 if slow > 1.0 + 1e-9 else 0.0
        rates = step / (self._params.period * max(slow, 1.0))
        return now, since, rates, [limited]
