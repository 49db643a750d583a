"""Wire forward actuation: what posture the wires' lengths impose."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import Angles, angles, angles_of_lengths, matrices
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
from systems.common.compiled import compiled, packed
from systems.common.geometry import all_finite
from systems.common.parameter import check
from systems.common.signal import Field, view
from systems.common.step_block import StepBlock


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


@compiled
def _ahead(
    c: Any, held: np.ndarray, lengths: Drums, rates: DrumRates
) -> tuple[SetPoint]:
    """The posture to be reached: that of the lengths a lead later."""
    wires, n = np.empty((1, len(lengths.wires))), len(held)
    wires[0] = np.array(lengths.wires) + c.lead * np.array(rates.wires)
    ab, off = np.empty((1, n - 1)), np.empty((1, len(c.inverse)))
    R, e, h = c.ball_radius, c.plate_thickness, c.half_pitch
    angles(wires, c.rows, c.inverse, R, e, h, ab, off)
    x: Any = np.empty(n)
    x[0], x[1:] = lengths.s + c.travel_lead * rates.s, ab[0]
    good: Any = x if all_finite(x) else held
    return (SetPoint(good, REST),)


class WireForwardActuation(StepBlock):
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
        snake = self._snake
        rows, inverse = matrices(
            snake.ball_radius, snake.face, tuple(snake.first_azimuths)
        )
        constants = packed(
            rows=rows,
            inverse=inverse,
            lead=drive.lead + period,
            travel_lead=drive.travel_lead + period,
            ball_radius=snake.ball_radius,
            plate_thickness=snake.plate_thickness,
            half_pitch=snake.half_pitch,
        )
        last, told = len(REST), {"lengths": Drums, "rates": DrumRates}
        run, reads = self._runner(
            _ahead, [constants], [last], told, [SetPoint], False, {}
        )
        # The last good set-point.
        self.DeclareDiscreteState(np.array(posture, float))
        ahead = self.cached("ahead", run, reads | {self.xd_ticket()})
        known = {ahead.ticket()}
        self.signal_out("desired_state", SetPoint, ahead.Eval, known)
        self._lengths = self.GetInputPort("lengths")
        ticket = {self._lengths.ticket()}
        self._angles = self.cached("angles", self._calc_angles, ticket)
        now = {*ticket, self._angles.ticket()}
        self.signal_out("posture", Posture, self._calc_posture, now)
        self.signal_out("residual", Residual, self._calc_residual, now)
        self.update_every(period, lambda context: ahead.Eval(context)[:last])

    def _calc_angles(self, context: Any) -> Angles:
        wires = view(Drums, self._lengths.Eval(context)).wires
        return angles_of_lengths(wires, self._snake)

    def _calc_posture(self, context: Any) -> np.ndarray:
        s = view(Drums, self._lengths.Eval(context)).s
        return np.append(s, self._angles.Eval(context).ab)

    def _calc_residual(self, context: Any) -> np.ndarray:
        residual: np.ndarray = self._angles.Eval(context).residual
        return residual
