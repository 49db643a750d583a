"""Wire statics: where the balls stay that wires, core and load act on."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.balls import angles_of, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams, flat_grip, grip_of
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array
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
from plants.snake.statics import Equilibrium, Statics
from plants.snake.statics_kernels import ROPES, Grip
from systems.common.block import Block
from systems.common.signal import Field, flat, view

NOWHERE = (0.0,) * BALL_POSITIONS


STEPS = 16
"""In which a period is gone through again to see whether the snake buckles."""


class BallSetPoint(NamedTuple):
    """What the plant's servos are told."""

    x: Annotated[Numbers, Field("m, rad", "s, then Rx, Ry, Rz a ball", NOWHERE)]
    v: Annotated[Numbers, Field("m/s, rad/s", "their rates, always zero", NOWHERE)]


def leaps(statics: Statics, grip: Grip, before: Array, now: Array) -> bool:
    """Whether the snake buckles between two instants, seen in small steps.

    The search for a distant equilibrium can lead over states in which the snake could
    not stay, though on its own way there it does. It buckles if in a small step the
    search does so, too, and the snake goes more than twice that step's share.

    Args:
        statics: The snake.
        grip: What it holds on to at first.
        before: Wound lengths and force on the tool then, (12,).
        now: The same at the end.
    """
    ways, astray = np.zeros(STEPS), np.zeros(STEPS, bool)
    for k in range(STEPS):
        acting = before + (k + 1) / STEPS * (now - before)
        wound, force = np.split(acting, [ROPES])
        found = statics.equilibrium(grip.turns, wound=wound, force=force, grip=grip)
        if not found.stable:
            return True
        ways[k] = np.abs(found.turns - grip.turns).max()
        astray[k], grip = found.buckled, found.grip
    return bool((astray & (ways > 2.0 * ways.mean())).any())


class WireStatics(Block):
    """Angles of six balls from wire lengths and the force on the tool.

    The snake is light and its motion slow: it is where its energy is least, downhill
    from where it was, as far as friction lets it. Set-points are taken ahead, as in
    `WireForwardActuation`. What is no number leaves them where they were.

    Port ``lengths`` accepts the `Drums`.
    Port ``rates`` accepts their `DrumRates`.
    Port ``force`` accepts the `ToolForce`.
    Port ``desired_state`` emits the `BallSetPoint`.
    Port ``tension`` emits the `Tensions` at the drums.
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
        self._statics = Statics(snake, drive, core, friction=friction)
        lag = self._statics.drive
        self._lead, self._travel_lead = lag.lead + period, lag.travel_lead + period
        self._lengths = self.signal_in("lengths", Drums)
        self._rates = self.signal_in("rates", DrumRates)
        self._force = self.signal_in("force", ToolForce)
        # What friction holds on to, R_i among it, and at the last update s, then
        # lengths and force, which are not known at first.
        start = flat_grip(self._statics.at_rest(turns_of(posture)))
        s, unknown = np.asarray(posture, float)[:1], np.full(ROPES + 3, np.nan)
        self.DeclareDiscreteState(np.concatenate([start, s]))
        self.DeclareDiscreteState(unknown)
        ports = {port.ticket() for port in (self._lengths, self._rates, self._force)}
        self._found = self.cached("found", self._calc_found, ports | {self.xd_ticket()})
        found = {self._found.ticket()}
        self.signal_out(
            "desired_state", BallSetPoint, self._calc_desired, ports | found
        )
        self.signal_out("tension", Tensions, self._calc_tension, found)
        self.signal_out("stability", Stability, self._calc_stability, found)
        self.update_every(period, lambda c: [self._calc_next(c), self._acting(c)])

    def _acting(self, context: Any) -> Array:
        """Lengths a lead later and the force on the tool, (12,)."""
        drums = view(Drums, self._lengths.Eval(context))
        rates = view(DrumRates, self._rates.Eval(context))
        wound = drums.wires + self._lead * rates.wires
        if not np.isfinite(wound).all():  # infinitely long is not slack
            wound = np.full_like(wound, np.nan)
        return np.concatenate([wound, self._force.Eval(context)])

    def _calc_found(self, context: Any) -> Equilibrium:
        """The equilibrium a lead later, downhill from that of the last update."""
        last = grip_of(context.get_discrete_state(0).value()[:-1])
        acting = self._acting(context)
        wound, force = np.split(acting, [ROPES])
        found = self._statics.equilibrium(
            self._statics.ahead(last), wound=wound, force=force, grip=last
        )
        if found.buckled and found.stable:
            before = context.get_discrete_state(1).value()
            found = found._replace(buckled=leaps(self._statics, last, before, acting))
        # Out of balance it falls downhill, as far as the search goes.
        if np.isfinite(flat_grip(found.grip)).all():
            return found
        return found._replace(turns=last.turns, grip=last)

    def _calc_s(self, context: Any) -> float:
        drums = view(Drums, self._lengths.Eval(context))
        rates = view(DrumRates, self._rates.Eval(context))
        s = float(drums.s + self._travel_lead * rates.s)
        return s if np.isfinite(s) else float(context.get_discrete_state(0).value()[-1])

    def _calc_next(self, context: Any) -> np.ndarray:
        grip = flat_grip(self._found.Eval(context).grip)
        return np.append(grip, self._calc_s(context))

    def _calc_desired(self, context: Any) -> np.ndarray:
        angles = angles_of(self._found.Eval(context).turns)
        return flat(BallSetPoint((self._calc_s(context), *angles), NOWHERE))

    def _calc_tension(self, context: Any) -> np.ndarray:
        tension: np.ndarray = self._found.Eval(context).T
        return tension

    def _calc_stability(self, context: Any) -> list[float]:
        found = self._found.Eval(context)
        return [found.least_eigenvalue, float(found.buckled or not found.stable)]
