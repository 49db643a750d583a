"""Wire watch: stops the drums at a slack or broken wire, or a lost posture."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.parameters import MODULES, WIRES
from plants.snake.signals import Stability, Stopped, Tensions
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field, example
from systems.common.step_block import StepBlock


class Alarm(NamedTuple):
    """A wire that has been slack, or a posture that is lost."""

    time: Annotated[float, Field("s", "of the alarm, -1 before", -1.0)]
    module: Annotated[float, Field("1", "1 to 3, 0 if it is lost, -1 before", -1.0)]


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


@compiled
def watch(
    params: Any,
    count: np.ndarray,
    alarm: Alarm,
    stopped: Stopped,
    time: float,
    tensions: Tensions,
    stability: Stability,
) -> tuple[np.ndarray, Alarm, Stopped]:
    """Slack samples in a row of each wire (9), the alarm, and whether to stop."""
    T = np.array(tensions.T)
    # A tension that is no number is not known to be enough.
    count = np.where(params.least <= T, 0.0, count + 1.0)
    if alarm.time < 0.0 and stability.lost != 0.0:
        alarm = Alarm(time, 0.0)
    if alarm.time < 0.0 and count.max() >= params.samples:
        alarm = Alarm(time, count.argmax() // WIRES + 1.0)
    return count, alarm, Stopped(1.0 if alarm.time >= 0.0 else 0.0)


class WireWatch(StepBlock):
    """Raises an alarm, and keeps it, once a wire has been slack for some samples.

    A wire that snaps lets the other two of its module go slack within a
    millisecond or two, and wires beyond it may follow: what can be told is the
    module, the one nearest to the base that has a slack wire. A posture that is lost,
    out of balance, unstable or buckled, raises it at once.

    Port ``tension`` accepts the `Tensions`, as load cells at the drums measure them.
    Port ``stability`` accepts the `Stability`; it need not be connected.
    Port ``stop`` emits whether the drums are `Stopped`, from the alarm on.
    Port ``alarm`` emits the `Alarm`.
    """

    def __init__(self, params: WireWatchParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or WireWatchParams())
        self.declare_update(
            watch,
            [packed(params)],
            {"tension": Tensions, "stability": Stability},
            {
                "_count": np.zeros(WIRES * MODULES),
                "alarm": Alarm(-1.0, -1.0),
                "stop": Stopped(0.0),
            },
            params.period,
            defaults={"stability": example(Stability)},
        )
