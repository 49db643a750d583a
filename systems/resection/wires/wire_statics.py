"""Wire statics: where the balls stay that wires, core and load act on."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.balls import angles_of, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.equilibrium import ahead, held, leaps
from plants.snake.friction import GRIP, SnakeFrictionParams, flat_grip
from plants.snake.parameters import WIRES, SnakeParams
from plants.snake.signals import (
    REST,
    DrumRates,
    Drums,
    Numbers,
    Stability,
    Tensions,
    ToolForce,
)
from plants.snake.snake import BALL_POSITIONS
from plants.snake.statics import Statics
from plants.snake.statics_kernels import ROPES
from systems.common.compiled import compiled, packed
from systems.common.signal import Field
from systems.common.step_block import StepBlock

NOWHERE = (0.0,) * BALL_POSITIONS


class BallSetPoint(NamedTuple):
    """What the plant's servos are told."""

    x: Annotated[Numbers, Field("m, rad", "s, then Rx, Ry, Rz a ball", NOWHERE)]
    v: Annotated[Numbers, Field("m/s, rad/s", "their rates, always zero", NOWHERE)]


@compiled
def _step(
    c: Any, snake: Any, last: np.ndarray, drums: Drums, rates: DrumRates, on: ToolForce
) -> tuple[np.ndarray, BallSetPoint, Tensions, Tensions, Stability]:
    """The equilibrium a lead later, downhill from that of the last update."""
    wound = np.array(drums.wires) + c.lead * np.array(rates.wires)
    if not np.isfinite(wound).all():  # infinitely long is not slack
        wound[:] = np.nan
    acting = np.append(wound, np.array(on.f))
    load = np.append(acting[ROPES:], np.zeros(3))
    grip = last[:GRIP]
    turns, T, P, least, after, astray, lost = held(
        grip, ahead(grip), c.stiffness, wound, load, snake
    )
    if astray and not lost:
        lost = leaps(grip, c.stiffness, last[GRIP + 1 :], acting, snake)
    s = drums.s + c.travel_lead * rates.s
    s = s if np.isfinite(s) else last[GRIP]
    x: Any = np.append(np.array([s]), angles_of(turns))
    still: Any = np.zeros(len(x))
    state = np.concatenate((after, np.array([s]), acting))
    stability = Stability(least, 1.0 if lost else 0.0)
    tension: Any = T
    tip: Any = T.copy()
    for w in range(len(T)):  # of a mean P over a ball what is beyond is 2 P - T
        for i in range(2 * (w // WIRES + 1)):
            tip[w] = 2 * P[i, w] - tip[w]
    set_point = BallSetPoint(x, still)
    return state, set_point, Tensions(tension), Tensions(tip), stability


class WireStatics(StepBlock):
    """Angles of six balls from wire lengths and the force on the tool.

    The snake is light and its motion slow: it is where its energy is least, downhill
    from where it was, as far as friction lets it. Set-points are taken ahead, as in
    `WireForwardActuation`. What is no number leaves them where they were.

    Port ``lengths`` accepts the `Drums`.
    Port ``rates`` accepts their `DrumRates`.
    Port ``force`` accepts the `ToolForce`.
    Port ``desired_state`` emits the `BallSetPoint`.
    Port ``tension`` emits the `Tensions` at the drums.
    Port ``tip_tension`` emits the `Tensions` at the tips, where wires end.
    Port ``stability`` emits the `Stability`.
    """

    def __init__(
        self,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        core: SnakeCoreParams | None = None,
        period: float = 0.02,
        posture: ArrayLike = REST,
        friction: SnakeFrictionParams | None = None,
    ) -> None:
        """Makes the block for a snake, its drive and core.

        Args:
            snake: Geometry.
            drive: Masses, gains and the wires' stiffness.
            core: What stands between the balls.
            period: Of the drums in s, and the integrator's step.
            posture: From which the first equilibrium is downhill, (7).
            friction: Of wires and sockets, which are at rest at first.
        """
        super().__init__()
        statics = Statics(snake, drive, core, friction=friction)
        lag = statics.drive
        constants = packed(
            lead=lag.lead + period,
            travel_lead=lag.travel_lead + period,
            stiffness=lag.wire_stiffness,
        )
        # What friction holds on to, R_i among it, and at the last update s, then
        # lengths and force, which are not known at first.
        start = flat_grip(statics.at_rest(turns_of(posture)))
        unknown = np.full(ROPES + 3, np.nan)
        self.declare_step(
            _step,
            [constants, statics.record],
            {"lengths": Drums, "rates": DrumRates, "force": ToolForce},
            np.concatenate([start, np.asarray(posture, float)[:1], unknown]),
            {
                "desired_state": BallSetPoint,
                "tension": Tensions,
                "tip_tension": Tensions,
                "stability": Stability,
            },
            period,
            timed=False,
        )
