"""Contact watch: tells from the wrench under the drive pack that the snake touches.

The weight of the model, in the posture asked for, is taken off; what is left at first
is the sensor's zero. What then is left of the mean over some samples is a contact's
force once it is larger than noise allows. The weight's force is the same in all
postures, so that force alone needs no model; its moment does, and tells the arm.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, bent_turns
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import Posture
from systems.common.compiled import compiled, packed
from systems.common.geometry import Vector, norm
from systems.common.parameter import check, parameter
from systems.common.signal import AXES, Field
from systems.common.step_block import StepBlock
from systems.resection.wires.base_sensor import BaseWrench, scale, weighed

MOST = 50
"""Samples of a window at most."""


class Contact(NamedTuple):
    """What touches the snake."""

    flag: Annotated[float, Field("1", "1 while something does", 0.0)]
    f: Annotated[
        Vector, Field("N", "its force, mean of the window", (0.0, 0.0, 0.0), AXES)
    ]
    arm: Annotated[float, Field("m", "of the force about W's origin, at least", 0.0)]


@dataclass
class ContactWatchParams:
    """Parameters of `ContactWatch`."""

    period: float = parameter(0.02, "of the samples", "s", least=1e-3, most=0.1)
    samples: int = parameter(5, "of the mean", least=1, most=MOST)
    zero: int = parameter(50, "samples at first that are the zero", least=1, most=1000)
    least: float = parameter(
        0.1, "mean force that is a contact", "N", above=0.0, most=10.0
    )


@compiled
def _step(
    c: Any, model: Any, last: np.ndarray, wrench: BaseWrench, posture: Posture
) -> tuple[np.ndarray, Contact]:
    """Count, the zero (6), the window (MOST, 6); and what it tells."""
    state, x = last.copy(), np.array(posture.x)
    left = np.array((*wrench.f, *wrench.m))
    turns = np.empty((BALLS, 3, 3))
    bent_turns(x, turns)
    f, m, _ = weighed(model, x[0], turns)
    left -= np.array((*f, *m))
    zero, window = state[1:7], state[7:].reshape((MOST, 6))
    n = int(c.samples)
    if np.isfinite(left).all():  # a sample that is none is left out
        state[0] += 1.0
        count = state[0]
        if count <= c.zero:
            zero += (left - zero) / count
        window[1:] = window[:-1].copy()
        window[0] = left
    if state[0] < c.zero + n:
        return state, Contact(0.0, (0.0, 0.0, 0.0), 0.0)
    mean = np.zeros(6)
    for i in range(n):
        mean += (window[i] - zero) / n
    force = (mean[0], mean[1], mean[2])
    size = norm(force)
    arm = norm((mean[3], mean[4], mean[5])) / max(size, 1e-9)
    return state, Contact(1.0 if size > c.least else 0.0, force, arm)


class ContactWatch(StepBlock):
    """Detects a contact anywhere on the snake.

    Port ``wrench`` accepts the `BaseWrench` that is measured.
    Port ``posture`` accepts the `Posture` asked for.
    Port ``contact`` emits the `Contact`.
    """

    def __init__(
        self,
        params: ContactWatchParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
    ) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or ContactWatchParams())
        snake, drive = check(snake or SnakeParams()), check(drive or SnakeDriveParams())
        self.declare_step(
            _step,
            [packed(params), scale(snake, drive)],
            {"wrench": BaseWrench, "posture": Posture},
            np.zeros(7 + 6 * MOST),
            {"contact": Contact},
            params.period,
            timed=False,
        )
