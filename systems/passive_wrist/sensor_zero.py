"""Sensor zero: what the wrist's sensor drifts by, learnt in its own frame M.

A bias looks like an offset of the wall, and a free shaft gives way to it. Across the
shaft, as complex numbers in M, force and moment are two readings of one side force at
the fulcrum's depth lambda,

    F = f_x + i f_y,    F_m = (m_y - i m_x) / lambda.

What they slowly disagree by is the force's, for the moment drifts by a third of that.
What is left, b, is common to both, and the estimate of the fulcrum is off by b / K. It
turns with the sensor when the arm rolls it by phi about the shaft, which tip and wall
do not feel; the wall stays. Of the estimate's mean over a breath,

    y = c + e^(i phi) b / K,

a Kalman filter of c, which may drift, and of b finds b. A bent tube would be one too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.instruments.wrist_sensor import Mount
from systems.common.compiled import compiled, packed
from systems.common.geometry import Pose, dot, inwards, outwards, sub, xyz
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, finiteness, flat, vector, view
from systems.common.signals import Fulcrum, Wrench
from systems.common.step_block import StepBlock, wired
from systems.passive_wrist.fulcrum_step import BREATHING
from systems.passive_wrist.wall_model import lateral_basis

finite_mount, finite_wrench = finiteness(Mount), finiteness(Wrench)
finite_fulcrum = finiteness(Fulcrum)
_SHALLOW = 0.05
"""Depth of the fulcrum from which the moment tells of the force, in m."""
_LONGEST = 8.0
"""Time of a mean, at the most, in s."""
_FIRST = 2e-4
"""What a mean is first taken to be off by, in m."""
_STRANGE = 8.0
"""Times what it is usually off by, from which the wall itself has moved."""


class SensorZero(NamedTuple):
    """What is taken from the sensor's reading, in M."""

    apart: Annotated[Vector, Field("N", "of the force alone", (0.05, -0.02, 0.0))]
    common: Annotated[Vector, Field("N", "of force and moment", (0.01, 0.03, 0.0))]
    sigma: Annotated[float, Field("N", "of each axis of that", 0.02)]


class Told(NamedTuple):
    """What the fulcrum estimator said last: place, K, rate, and 1 once it is sure."""

    p: Vector
    stiffness: float
    rate: float
    sure: float


WALL, WALKS, COMMON = range(3)
"""States of the filter, complex: c in m, its rate in m/s, b in N."""
APART, SUM_Y, SUM_H = range(3)
"""Complex too: what force and moment disagree by in N; sums of y in m and of
e^(i phi) / K in m/N over a breath."""
_SUMS, POWER, COUNT, BEGUN, MEMORY = 24, 30, 31, 32, 33
"""Of the memory: where those begin, after states and covariance; smoothed square in m^2
of what a mean is off by; samples in the sums; 1 once there was a mean; its size."""


@dataclass
class SensorZeroParams:
    """How the zero is followed."""

    apart_time: float = parameter(
        20.0, "in which force follows moment", "s", above=0, most=1e3
    )
    # Over it they disagree for other reasons as well: a depth that is wrong.
    small: float = parameter(0.5, "force up to which it does", "N", above=0, most=5)
    common: bool = parameter(
        True, "whether b is sought: the sensor must be rolled for it"
    )
    first: float = parameter(
        0.01, "standard deviation of b after taring", "N", least=0, most=1
    )
    drift: float = parameter(0.002, "random walk of b", "N/sqrt(s)", least=0, most=0.1)
    wall_walk: float = parameter(
        1e-5, "random walk of the wall's mean place", "m/sqrt(s)", above=0, most=1e-2
    )
    wall_rate: float = parameter(
        1e-5, "at which it may drift at first", "m/s", above=0, most=1e-2
    )
    wall_pull: float = parameter(
        2e-7, "random walk of that", "m/s/sqrt(s)", above=0, most=1e-3
    )
    noise: float = parameter(
        3e-5, "of a mean over a breath, at the least", "m", above=0, most=1e-2
    )
    most: float = parameter(0.5, "of b", "N", least=0, most=5)
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


@compiled
def mean_taken(c: Any, s: np.ndarray, time: float) -> None:
    """The Kalman filter's step at a breath's end, in place.

    Args:
        c: A record of the parameters.
        s: Memory.
        time: That the sums have taken in s.
    """
    x, P = s[:6].view(np.complex128), s[6:_SUMS].view(np.complex128).reshape((3, 3))
    sums = s[_SUMS:POWER].view(np.complex128)
    y, h = sums[SUM_Y] / s[COUNT], sums[SUM_H] / s[COUNT]
    sums[SUM_Y], sums[SUM_H], s[COUNT] = 0.0, 0.0, 0.0
    x[WALL] += time * x[WALKS]
    P[WALL] += time * P[WALKS]
    P[:, WALL] += time * P[:, WALKS]
    for i, walk in ((WALL, c.wall_walk), (WALKS, c.wall_pull), (COMMON, c.drift)):
        P[i, i] += walk**2 * time
    off = y - x[WALL] - h * x[COMMON]
    square = off.real**2 + off.imag**2
    gain = P[:, WALL] + P[:, COMMON] * h.conjugate()
    S = (gain[WALL] + h * gain[COMMON]).real + max(c.noise**2, s[POWER])
    if s[BEGUN] == 0.0 or square > _STRANGE**2 * S:  # the wall is elsewhere
        x[WALL], s[BEGUN] = y - h * x[COMMON], 1.0
        P[WALL] = 0.0
        P[:, WALL] = 0.0
        P[WALL, WALL] = S
        return
    s[POWER] += 0.1 * (square - s[POWER])
    x += off / S * gain
    P -= np.outer(gain, gain.conjugate()) / S
    x[COMMON] *= min(1.0, c.most / max(abs(x[COMMON]), 1e-12))


@compiled
def zeroed(
    c: Any, old: np.ndarray, told: Told, mount: Mount, wrench: Wrench
) -> tuple[np.ndarray, Wrench, SensorZero]:
    """One reading: the memory, what is left of it, and what was taken away.

    Args:
        c: A record of the parameters.
        old: Memory.
        told: What the estimator said last.
        mount: The sensor's frame.
        wrench: What it reads, in W.
    """
    s = old.copy()
    sums = s[_SUMS:POWER].view(np.complex128)
    b = complex(s[2 * COMMON], s[2 * COMMON + 1])
    if finite_mount(mount) and wrench.valid > 0.5 and finite_wrench(wrench):
        M = Pose(mount.p, mount.x, mount.y, mount.z)
        f, m = inwards(M, wrench.f), inwards(M, wrench.m)
        depth = max(dot(mount.z, sub(told.p, mount.p)), _SHALLOW)
        by_force, by_moment = complex(f[0], f[1]), complex(m[1], -m[0]) / depth
        if abs(by_force - sums[APART] - b) < c.small:
            share = c.period / c.apart_time
            sums[APART] += share * (by_force - by_moment - sums[APART])
        taken, moment = sums[APART] + b, depth * b
        wrench = Wrench(
            sub(wrench.f, outwards(M, (taken.real, taken.imag, 0.0))),
            sub(wrench.m, outwards(M, (-moment.imag, moment.real, 0.0))),
            wrench.valid,
        )
        if c.common > 0.0 and told.sure > 0.0:
            x, y = xyz(c.x_axis, 0), xyz(c.y_axis, 0)
            turned = complex(dot(mount.x, x), dot(mount.x, y))
            h = turned / max(abs(turned), 1e-6) / told.stiffness
            sums[SUM_Y] += complex(dot(told.p, x), dot(told.p, y)) + h * b
            sums[SUM_H] += h
            s[COUNT] += 1.0
            time = s[COUNT] * c.period
            if time * told.rate >= 1.0 or time >= _LONGEST:
                mean_taken(c, s, time)
    apart = (sums[APART].real, sums[APART].imag, 0.0)
    sigma = sqrt(0.5 * s[6 + 2 * (3 * COMMON + COMMON)])
    return s, wrench, SensorZero(apart, (b.real, b.imag, 0.0), sigma)


class SensorZeroing(StepBlock):
    """Takes from the wrist's wrench what its sensor has drifted by.

    Port ``mount`` accepts the sensor's `Mount`.

    Port ``wrench`` accepts the `Wrench` of the sensor.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`; that of the instant
    before is used, since the estimate in turn is made of what this block emits.

    Port ``zeroed`` emits the `Wrench` without the drift.

    Port ``zero`` emits the `SensorZero`.
    """

    def __init__(
        self,
        params: SensorZeroParams | None = None,
        guess: Sequence[float] = (0.0, 0.0, 0.0),
        axis: Sequence[float] = (0.0, 0.0, -1.0),
    ) -> None:
        """Makes the block, the fulcrum guessed at p_WI [m], the shaft about an axis."""
        super().__init__()
        params = check(params or SensorZeroParams())
        x, y = lateral_basis(vector(axis))
        self._constants = packed(params, x_axis=x, y_axis=y)
        self._mount = self.signal_in("mount", Mount)
        self._wrench = self.signal_in("wrench", Wrench)
        self._estimate = self.signal_in("estimate", Fulcrum)
        memory = np.zeros(MEMORY)
        P = np.diag([_FIRST, params.wall_rate, params.first]).astype(complex) ** 2
        memory[6:_SUMS], memory[POWER] = 2.0 * P.ravel().view(float), _FIRST**2
        self.DeclareDiscreteState(memory)
        self.DeclareDiscreteState(flat(Told(vector(guess), 1.0, 0.0, 0.0)))
        self._run = wired(
            zeroed,
            1,
            [MEMORY, Told],
            [Mount, Wrench],
            [MEMORY, Wrench, SensorZero],
            False,
        )
        reads = {self.xd_ticket(), self._mount.ticket(), self._wrench.ticket()}
        self._next = self.cached("next", self._calc_next, reads)
        self._emit(
            self._next.Eval,
            {self._next.ticket()},
            {"zeroed": Wrench, "zero": SensorZero},
            MEMORY,
        )
        self.update_every(params.period, self._calc_update)

    def _calc_next(self, context: Any) -> np.ndarray:
        after: np.ndarray = self._run(
            self._constants,
            context.get_discrete_state(0).value(),
            context.get_discrete_state(1).value(),
            self._mount.Eval(context),
            self._wrench.Eval(context),
        )
        return after

    def _calc_update(self, context: Any) -> list[np.ndarray]:
        told = view(Fulcrum, self._estimate.Eval(context))
        sure = float(told.phase == BREATHING)
        known = [*told.p, told.stiffness, told.rate, sure]
        after = self._next.Eval(context)[:MEMORY]
        return [after, self.finite_or_kept(context, 1, known)]
