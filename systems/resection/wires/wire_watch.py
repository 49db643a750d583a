"""Wire watch: notices a slack or broken wire and stops the drums."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.parameter import check, parameter


@dataclass
class WireWatchParams:
    """Parameters of `WireWatch`."""

    period: float = parameter(
        0.02, "at which tensions are sampled", "s", least=1e-3, most=0.1
    )
    least: float = parameter(
        0.5, "tension below which a wire counts as slack", "N", above=0.0, most=50.0
    )
    samples: int = parameter(
        2, "slack samples in a row that raise the alarm", least=1, most=10
    )


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
        self._params = check(params or WireWatchParams())
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
