"""Registration: where the tracker's frame lies in the robot's, found while it runs.

The tracker sees the robot's own instrument as it sees the others, and the arm's joints
say where it really is. What differs is the error of the registration, a small rotation
theta about the origin of W and a shift t,

    p_seen = p + t + theta x p,    u_seen = u + theta x u,

which a Kalman filter of six states follows; a slow random walk lets it follow a tracker
that is bumped. The markers' mean, on the handle, is seen ten times better than the tip,
so it is what is compared, and the arm's pose is that of the frame's exposure. All other
tools' frames are then moved back.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.signals import ArmState
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, cross, dot, sub, unit, xyz
from systems.common.parameter import check, parameter
from systems.common.serial_arm import read_arm, tip_frame
from systems.common.signal import Vector, finiteness, flat
from systems.common.signals import Alignment, TrackedShaft
from systems.common.step_block import wired
from systems.sensing.optical_tracker import MarkerBody

finite_state, finite_frame = finiteness(ArmState), finiteness(TrackedShaft)
_IN_TIME = 2e-3  # s, between a frame's exposure and the arm's pose that it is held to


class Seen(NamedTuple):
    """The arm's tool at the last instant: markers' mean, axis, time; the residual."""

    c: Vector
    u: Vector
    time: float
    residual: float


@dataclass
class RegistrationParams:
    """How the registration is mended."""

    active: bool = parameter(False, "whether the robot's own tool is seen, and used")
    first_shift: float = parameter(
        2e-3, "deviation at first, along each axis", "m", least=0, most=0.05
    )
    first_turn: float = parameter(
        0.01, "likewise, about each axis", "rad", least=0, most=0.2
    )
    drift: float = parameter(
        2e-5, "random walk of the shift", "m/sqrt(s)", least=0, most=0.01
    )
    turn_drift: float = parameter(
        1e-4, "of the rotation", "rad/sqrt(s)", least=0, most=0.1
    )
    period: float = parameter(
        1 / 60, "of the update: the tracker's", "s", above=0, most=1
    )


@compiled
def moved_back(x: np.ndarray, frame: TrackedShaft) -> TrackedShaft:
    """A frame of the tracker where W has it, by the error x: t in m, theta in rad."""
    t, theta = xyz(x, 0), xyz(x, 3)
    p = sub(frame.tip, t)
    # The inverse to second order; at a degree what is left is a micrometre.
    for _ in range(2):
        p = sub(sub(frame.tip, t), cross(theta, p))
    u = frame.u
    for _ in range(2):
        u = sub(frame.u, cross(theta, u))
    return TrackedShaft(p, unit(u, frame.u), frame.time, frame.valid)


@compiled
def learnt(
    c: Any, x: np.ndarray, P: np.ndarray, seen: Seen, frame: TrackedShaft
) -> tuple[np.ndarray, np.ndarray, float]:
    """Error, covariance and residual in m after a frame of R's own tool."""
    p = along(frame.tip, -c.lever, frame.u)
    places, axis = sub(p, seen.c), sub(frame.u, seen.u)
    residual = 0.0
    for k in range(6):
        place = k < 3
        base = seen.c if place else seen.u
        i = k % 3
        e = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
        turn = cross(base, e)  # e . (theta x base) = theta . (base x e)
        h = np.zeros(6)
        if place:
            h[k] = 1.0
        h[3], h[4], h[5] = turn
        error = (dot(places, e) if place else dot(axis, e)) - np.dot(h, x)
        variance = c.var_place if place else c.var_axis
        if place:
            residual += error * error
        Ph = np.zeros(6)
        for row in range(6):
            Ph[row] = np.dot(P[row], h)
        gain = Ph / (np.dot(h, Ph) + variance)
        x = x + gain * error
        P = P - np.outer(gain, Ph)
    return x, P, sqrt(residual)


@compiled
def _follow(
    c: Any,
    arm: Any,
    x: np.ndarray,
    P: np.ndarray,
    seen: Seen,
    time: float,
    measured: ArmState,
    frame: TrackedShaft,
) -> tuple[np.ndarray, np.ndarray, Seen, Alignment]:
    """One instant: the error, its covariance, what is remembered, what is told."""
    P = P.copy().reshape((6, 6))
    for k in range(6):
        drift = c.drift if k < 3 else c.turn_drift
        P[k, k] += drift * drift * c.period
    residual = seen.residual
    good = frame.valid > 0.5 and finite_frame(frame)
    if good and abs(frame.time - seen.time) < _IN_TIME:
        x, P, last = learnt(c, x, P, seen, frame)
        residual += 0.05 * (last - residual)
    after = Seen(seen.c, seen.u, -1.0, residual)
    if finite_state(measured):
        p, _, u = tip_frame(arm, measured.q)
        after = Seen(along(p, -c.lever, u), u, time, residual)
    # Of a point a hand's breadth below the origin.
    variance = 0.0
    for k in range(3):
        variance += (P[k, k] + c.depth**2 * P[3 + k, 3 + k]) / 3.0
    told = Alignment(xyz(x, 0), xyz(x, 3), sqrt(variance), residual)
    return x, P.reshape(36), after, told


@compiled
def _back(state: np.ndarray, frame: TrackedShaft) -> tuple[TrackedShaft]:
    return (moved_back(state, frame),)


class Registration(Block):
    """Mends the registration of tracker and robot, and the tools' frames by it.

    Port ``arm_state`` accepts the measured `ArmState`.

    Port ``robot_measured`` accepts the `TrackedShaft` of the robot's own tool.

    Ports ``target_measured`` and ``obstacle_measured``, or of whatever names the tools
    have, accept their `TrackedShaft` as the tracker tells it.

    Ports ``target`` and ``obstacle``, likewise, emit it in W.

    Port ``alignment`` emits the `Alignment`, after the last instant.
    """

    def __init__(
        self,
        params: RegistrationParams | None = None,
        tools: Sequence[str] = ("target", "obstacle"),
        body: MarkerBody | None = None,
        instrument: InstrumentParams | None = None,
    ) -> None:
        """Makes the block.

        Args:
            params: How it is mended.
            tools: Names of the tools.
            body: The markers, on the robot's tool as on the others.
            instrument: The robot's.
        """
        super().__init__()
        params, body = check(params or RegistrationParams()), body or MarkerBody()
        plant = make_controller_plant(instrument=instrument)
        self._arm = read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))
        self._constants = packed(
            params,
            lever=body.lever,
            depth=0.12,
            var_place=max(body.sigma_position(), 1e-6) ** 2,
            var_axis=max(body.sigma_direction(), 1e-6) ** 2,
        )
        self._run = wired(
            _follow,
            2,
            [6, 36, Seen],
            [ArmState, TrackedShaft],
            [6, 36, Seen, Alignment],
            True,
        )
        self._state = self.signal_in("arm_state", ArmState)
        self._frame = self.signal_in("robot_measured", TrackedShaft)
        first = [params.first_shift**2] * 3 + [params.first_turn**2] * 3
        self.DeclareDiscreteState(6)
        self.DeclareDiscreteState(np.diag(first).ravel())
        self.DeclareDiscreteState([0.0] * 6 + [-1.0, 0.0])
        self.state_out(
            "alignment", Alignment, flat(Alignment((0.0,) * 3, (0.0,) * 3, 0.01, 0.0))
        )
        back = wired(_back, 0, [6], [TrackedShaft], [TrackedShaft], False)
        for name in tools:
            port = self.signal_in(f"{name}_measured", TrackedShaft)

            def mended(context: Any, port: Any = port) -> np.ndarray:
                x = context.get_discrete_state(0).value()
                frame: np.ndarray = back(x, port.Eval(context))
                return frame

            reads = {self.xd_ticket(), port.ticket()}
            self.signal_out(name, TrackedShaft, mended, reads)
        self.update_every(params.period, self._update)

    def _update(self, context: Any) -> list[np.ndarray]:
        states = [context.get_discrete_state(k).value() for k in range(3)]
        after = self._run(
            self._constants,
            self._arm,
            *states,
            context.get_time(),
            self._state.Eval(context),
            self._frame.Eval(context),
        )
        return [after[:6], after[6:42], after[42:50], after[50:]]
