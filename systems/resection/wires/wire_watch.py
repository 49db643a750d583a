"""Wire watch: notices a slack or broken wire and stops the drums."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from systems.common.block import Block


@dataclass
class WireWatchParams:
    """Parameters of `WireWatch`.

    Attributes:
        period: At which tensions are sampled, in s.
        least: Tension below which a wire counts as slack, in N.
        samples: Slack samples in a row that raise the alarm.
    """

    period: float = 0.02
    least: float = 0.5
    samples: int = 2

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        if not self.period > 0.0:
            raise ValueError(f"wire_watch.period={self.period} s: expected > 0")
        if not self.least >= 0.0:
            raise ValueError(f"wire_watch.least={self.least} N: expected >= 0")
        if self.samples < 1:
            raise ValueError(f"wire_watch.samples={self.samples}: expected >= 1")


class WireWatch(Block):
    """Raises an alarm, and keeps it, once a wire has been slack for some samples.

    A wire that snaps lets the other two of its module go slack within a
    millisecond or two, and wires beyond it may follow: what can be told is the
    module, the one nearest to the base that has a slack wire.

    Port ``tension`` accepts the tension of wires 0 to 8, as load cells at the drums
    measure them [N] (9).

    Port ``stop`` emits 0, and 1 from the alarm on (1).

    Port ``alarm`` emits the alarm's time [s] and the module, 1 to 3, or -1 and -1 (2).
    """

    def __init__(self, params: WireWatchParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._params = params or WireWatchParams()
        self._params.check()
        self._tension = self.vector_in("tension", [4.0] * 9)
        self._count = self.DeclareDiscreteState([0.0] * 9)  # slack samples in a row
        self._alarm = self.state_out("alarm", [-1.0, -1.0])
        self.state_out("stop", [0.0])
        self.update_every(self._params.period, self._update)

    def _update(self, context: Any) -> Sequence[Sequence[float]]:
        slack = self._tension.Eval(context) < self._params.least
        before = context.get_discrete_state(self._count).value()
        count = np.where(slack, before + 1.0, 0.0)
        alarm = context.get_discrete_state(self._alarm).value().tolist()
        if alarm[0] < 0.0 and count.max() >= self._params.samples:
            alarm = [context.get_time(), float(count.argmax() // 3 + 1)]
        return count.tolist(), alarm, [float(alarm[0] >= 0.0)]
