"""Tension estimator: between which bounds a wire's tension at its tip is.

A load cell at a drum sees T_0. Over each ball, of a turn theta, friction changes it by
a factor between exp(-mu theta) and exp(mu theta), so that the tip's is in an interval.
Once the wire has run over a ball one way for long enough it slides there, and the sign
is known: tension grows towards the tip where the path beyond the ball does.

Sound are the wide bounds, if mu and theta are within what they are told to be. The
direction is told by the posture asked for, which true balls follow but for friction:
that they have turned round once it has run `sure` the other way is an assumption.
"""

from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, bent_turns
from plants.snake.friction import turning
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.signals import WIRE_NAMES, Numbers, Posture, Tensions
from plants.snake.statics import Statics
from plants.snake.statics_kernels import ROPES, chord, path_over
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field
from systems.common.step_block import StepBlock


class TensionInterval(NamedTuple):
    """Between which bounds the wires' tensions at their tips are."""

    lower: Annotated[Numbers, Field("N", "at least", (3.0,) * ROPES, WIRE_NAMES)]
    upper: Annotated[
        Numbers,
        Field("N", "at most", (5.0,) * ROPES, tuple(f"{w}_most" for w in WIRE_NAMES)),
    ]


@dataclass
class TensionEstimatorParams:
    """Parameters of `TensionEstimator`."""

    wire: float = parameter(0.1, "mu, of wires on balls", least=0.0, most=1.0)
    doubt: float = parameter(
        0.3, "share of mu by which it may be wrong", least=0.0, most=1.0
    )
    margin: float = parameter(
        0.1, "by which a ball may turn otherwise than asked", "rad", least=0.0, most=0.5
    )
    sure: float = parameter(
        0.0,
        "path one way over a ball after which a wire slides there; 0 for never",
        "m",
        least=0.0,
        most=0.1,
    )
    period: float = parameter(0.02, "of the samples", "s", least=1e-3, most=0.1)


@compiled
def _step(
    c: Any, s: Any, last: np.ndarray, tension: Tensions, posture: Posture
) -> tuple[np.ndarray, TensionInterval]:
    """The last posture, and what each path drags along; the bounds."""
    state = last.copy()
    x = np.array(posture.x)
    if np.isfinite(x).all():
        state[: len(x)] = x
    dragged = state[len(x) :].reshape((BALLS, ROPES))
    turns = np.empty((BALLS, 3, 3))
    bent_turns(state[: len(x)], turns)
    lower: Any = np.array(tension.T)
    upper: Any = np.array(tension.T)
    most, least = c.wire * (1.0 + c.doubt), c.wire * (1.0 - c.doubt)
    for w in range(ROPES):
        beyond = 0.0
        for i in range(2 * (w // WIRES + 1) - 1, -1, -1):
            path, _, _ = path_over(chord(turns[i], w, s), s)
            at, beyond = beyond + 0.5 * path, beyond + path
            theta = turning(turns[i], w, s)
            far = math.exp(most * (theta + c.margin))
            near = math.exp(least * max(theta - c.margin, 0.0))
            ahead = at - dragged[i, w]
            if math.isnan(ahead):
                dragged[i, w], ahead = at, 0.0
            if abs(ahead) > 0.5 * c.sure:
                dragged[i, w] = at - math.copysign(0.5 * c.sure, ahead)
            known = c.sure > 0.0 and abs(ahead) >= 0.5 * c.sure * (1 - 1e-6)
            lower[w] *= near if known and ahead > 0.0 else 1.0 / far
            upper[w] *= 1.0 / near if known and ahead < 0.0 else far
    return state, TensionInterval(lower, upper)


class TensionEstimator(StepBlock):
    """Bounds of each wire's tension at its tip, from that at its drum.

    Port ``tension`` accepts the `Tensions` at the drums.
    Port ``posture`` accepts the `Posture` asked for.
    Port ``interval`` emits the `TensionInterval`.
    """

    def __init__(
        self,
        params: TensionEstimatorParams | None = None,
        snake: SnakeParams | None = None,
    ) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or TensionEstimatorParams())
        unknown = np.full(BALLS * ROPES, np.nan)
        self.declare_step(
            _step,
            [packed(params), Statics(snake).record],
            {"tension": Tensions, "posture": Posture},
            np.append(np.zeros(1 + 2 * MODULES), unknown),
            {"interval": TensionInterval},
            params.period,
            timed=False,
        )
