"""Wire forward actuation: what posture the wires' lengths impose."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import Angles, angles_of_lengths
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import (
    MODULE_NUMBERS,
    REST,
    DrumRates,
    Drums,
    Numbers,
    Posture,
)
from systems.common.block import Block
from systems.common.parameter import check
from systems.common.signal import Field, flat, view


class Residual(NamedTuple):
    """How far each module's three wires disagree."""

    modules: Annotated[
        Numbers,
        Field(
            "1",
            "|u|^2 - 1 of `plants.snake.actuation`",
            (0.0,) * len(MODULE_NUMBERS),
            tuple(f"module{k}" for k in MODULE_NUMBERS),
        ),
    ]


class SetPoint(NamedTuple):
    """What the plant's servos are told."""

    x: Annotated[Numbers, Field("m, rad", "s, a1, b1, ..., a3, b3", REST)]
    v: Annotated[Numbers, Field("m/s, rad/s", "their rates, always zero", REST)]


class WireForwardActuation(Block):
    """Angles from wire lengths, module after module (paper, IV.B.2 and IV.C).

    The plant's springs stand for wires and drums; their set-point is the posture
    that the lengths impose, taken ahead by the time that damping lags and that the
    integrator holds it. Lengths or rates that are no numbers, or lengths that no
    posture has, leave it where it was.

    Port ``lengths`` accepts the `Drums`.
    Port ``rates`` accepts their `DrumRates`.
    Port ``posture`` emits the `Posture`.
    Port ``residual`` emits the `Residual`.
    Port ``desired_state`` emits the `SetPoint`.
    """

    def __init__(
        self,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        period: float = 0.02,
        posture: ArrayLike = REST,
    ) -> None:
        """Makes the block for a snake and its drive.

        Args:
            snake: Geometry.
            drive: Masses and gains.
            period: Of the drums in s, and the integrator's step: CENIC takes set-points
                as they are at a step's start, and brings the joints there by its end.
            posture: The first, (7).
        """
        super().__init__()
        self._snake = check(snake or SnakeParams())
        drive = check(drive or SnakeDriveParams())
        self._lead, self._travel_lead = drive.lead + period, drive.travel_lead + period
        self._lengths = self.signal_in("lengths", Drums)
        self._rates = self.signal_in("rates", DrumRates)
        # The last good set-point.
        self._held = self.DeclareDiscreteState(np.array(posture, float))
        ticket = {self._lengths.ticket()}
        self._angles = self.cached("angles", self._calc_angles, ticket)
        now = {*ticket, self._angles.ticket()}
        both = {*ticket, self._rates.ticket(), self.xd_ticket()}
        self._ahead = self.cached("ahead", self._calc_ahead, both)
        self.signal_out("posture", Posture, self._calc_posture, now)
        self.signal_out("residual", Residual, self._calc_residual, now)
        self.signal_out(
            "desired_state", SetPoint, self._calc_desired_state, {self._ahead.ticket()}
        )
        self.update_every(period, self._ahead.Eval)

    def _calc_angles(self, context: Any) -> Angles:
        wires = view(Drums, self._lengths.Eval(context)).wires
        return angles_of_lengths(wires, self._snake)

    def _calc_posture(self, context: Any) -> np.ndarray:
        s = view(Drums, self._lengths.Eval(context)).s
        return np.append(s, self._angles.Eval(context).ab)

    def _calc_residual(self, context: Any) -> np.ndarray:
        residual: np.ndarray = self._angles.Eval(context).residual
        return residual

    def _calc_ahead(self, context: Any) -> np.ndarray:
        """The posture (7) to be reached: that of the lengths a lead later."""
        drums = view(Drums, self._lengths.Eval(context))
        rates = view(DrumRates, self._rates.Eval(context))
        wires = drums.wires + self._lead * rates.wires
        s = drums.s + self._travel_lead * rates.s
        x = np.append(s, angles_of_lengths(wires, self._snake).ab)
        if np.isfinite(x).all():
            return x
        return np.array(context.get_discrete_state(self._held).value())

    def _calc_desired_state(self, context: Any) -> np.ndarray:
        return flat(SetPoint(self._ahead.Eval(context), REST))
