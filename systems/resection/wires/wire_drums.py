"""Wire drums: nine motors that wind wires, and the one that slides the robot."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import length_range, wire_lengths
from plants.snake.parameters import DRUMS, MODULES, WIRES, SnakeParams
from plants.snake.signals import REST, DrumRates, Drums, Stopped
from systems.common.compiled import compiled, packed
from systems.common.geometry import all_finite
from systems.common.parameter import check, parameter
from systems.common.signal import Field, example
from systems.common.step_block import StepBlock


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


@compiled
def wound(start: Any, rates: Any, elapsed: float) -> np.ndarray:
    """What is wound out some time after an update, (10,)."""
    return start[:DRUMS] + elapsed * rates


@compiled
def _update(
    c: Any,
    start: np.ndarray,
    rates: DrumRates,
    limited: Limited,
    time: float,
    command: Drums,
    stop: Stopped,
) -> tuple[np.ndarray, DrumRates, Limited]:
    goal, now = np.array((*command.wires, command.s)), np.empty(len(start))
    elapsed = min(time - start[DRUMS], c.period)
    now[:DRUMS] = wound(start, np.array((*rates.wires, rates.s)), elapsed)
    now[DRUMS] = time
    if stop.flag != 0.0 or not all_finite(goal):
        still: Any = np.zeros(DRUMS - 1)
        return now, DrumRates(still, 0.0), Limited(0.0)
    within = np.minimum(np.maximum(goal, c.low), c.high)
    step: Any = within - now[:DRUMS]
    slow = (np.abs(step) / c.most).max()
    code = 2.0 if (within != goal).any() else 1.0 if slow > 1.0 + 1e-9 else 0.0
    step /= c.period * max(slow, 1.0)
    return now, DrumRates(step[: DRUMS - 1], step[DRUMS - 1]), Limited(code)


class WireDrums(StepBlock):
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
        params = check(params or WireDrumsParams())
        snake = check(snake or SnakeParams())
        low, high = length_range(snake)
        s_min, s_max = snake.travel
        if lengths is None:
            lengths = np.append(wire_lengths(REST, snake), 0.0)
        rates = np.append([params.wire_rate] * (WIRES * MODULES), params.travel_rate)
        self._period = params.period
        self.declare_update(
            _update,
            [
                packed(
                    low=np.append(low - params.margin, s_min),
                    high=np.append(high + params.margin, s_max),
                    most=params.period * rates,
                    period=params.period,
                )
            ],
            {"command": Drums, "stop": Stopped},
            {
                "_start": np.append(np.array(lengths, float), 0.0),  # and its instant
                "rates": example(DrumRates),
                "limited": example(Limited),
            },
            params.period,
        )
        tickets = {self.xd_ticket(), self.time_ticket()}
        self.signal_out("lengths", Drums, self._calc_lengths, tickets)

    def _calc_lengths(self, context: Any) -> np.ndarray:
        start, rates = (context.get_discrete_state(i).value() for i in (0, 1))
        return wound(start, rates, min(context.get_time() - start[-1], self._period))
