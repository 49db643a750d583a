"""Wire statics: where the balls stay that wires, core and load act on."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.balls import angles_of, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams, flat_grip, grip_of
from plants.snake.parameters import SnakeParams
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
from systems.common.block import Block
from systems.common.signal import Field, flat, view

NOWHERE = (0.0,) * BALL_POSITIONS


class BallSetPoint(NamedTuple):
    """What the plant's servos are told."""

    x: Annotated[Numbers, Field("m, rad", "s, then Rx, Ry, Rz a ball", NOWHERE)]
    v: Annotated[Numbers, Field("m/s, rad/s", "their rates, always zero", NOWHERE)]


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
        # What friction holds on to, R_i among it, and s at the last update.
        start = flat_grip(self._statics.at_rest(turns_of(posture)))
        self.DeclareDiscreteState(np.append(start, np.asarray(posture, float)[0]))
        ports = {port.ticket() for port in (self._lengths, self._rates, self._force)}
        self._found = self.cached("found", self._calc_found, ports | {self.xd_ticket()})
        found = {self._found.ticket()}
        self.signal_out(
            "desired_state", BallSetPoint, self._calc_desired, ports | found
        )
        self.signal_out("tension", Tensions, self._calc_tension, found)
        self.signal_out("stability", Stability, self._calc_stability, found)
        self.update_every(period, self._calc_next)

    def _calc_found(self, context: Any) -> Equilibrium:
        """The equilibrium a lead later, downhill from that of the last update."""
        drums = view(Drums, self._lengths.Eval(context))
        rates = view(DrumRates, self._rates.Eval(context))
        last = grip_of(context.get_discrete_state(0).value()[:-1])
        wound = drums.wires + self._lead * rates.wires
        if not np.isfinite(wound).all():  # infinitely long is not slack
            wound = np.full_like(wound, np.nan)
        force = self._force.Eval(context)
        found = self._statics.equilibrium(
            self._statics.ahead(last), wound=wound, force=force, grip=last
        )
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
