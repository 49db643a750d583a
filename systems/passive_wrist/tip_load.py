"""Tip load: what of the wrist's wrench is the wall's, and what the tip's.

On one straight shaft act the wall's side force f_w at the fulcrum's depth lambda, its
torque tau where the trocar resists turning, and a side force f_t at the tip, L away:

    f = f_w + f_t,    m = lambda u x f_w + L u x f_t + tau.

With the depth known, what the force at the fulcrum leaves unexplained is

    r = m - lambda u x f = (L - lambda) u x f_t + tau,

two numbers for four: one instant cannot tell tip from torque. Motion can. A trocar's
torque follows the shaft's tilt phi from the wall's normal, tau = c - k phi, and k and c
are learnt while nothing touches the tip (a Kalman filter); a touch comes of a sudden,
and what then exceeds tau is the tip's, until it is gone. What is left is the wall's, so
that neither pulls the fulcrum. A touch that grows more slowly than c is learnt to
drift is taken for torque.
"""

from dataclasses import dataclass
from math import acos, exp, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    Vector,
    across,
    along,
    cross,
    dot,
    norm,
    scaled,
    sub,
)
from systems.common.parameter import check, parameter
from systems.common.signal import Field, finiteness, flat, size, view
from systems.common.signals import Fulcrum, ShaftMotion, Wrench
from systems.common.step_block import StepBlock, wired
from systems.passive_wrist.wall_model import lateral_basis

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)
finite_fulcrum = finiteness(Fulcrum)
_NORMAL = (0.0, 0.0, -1.0)
_SMALL = 0.5
"""Force up to which torque is learnt, N: with more, a wrong depth would be."""


class TipForce(NamedTuple):
    """What pushes the tip sideways."""

    f: Annotated[Vector, Field("N", "on the tip, across the shaft", (0.5, 0.0, 0.0))]
    contact: Annotated[float, Field("1", "1 while something touches it, else 0", 1.0)]
    torque_stiffness: Annotated[float, Field("N m/rad", "k of the trocar", 0.3)]
    sigma: Annotated[float, Field("N", "of f along each axis", 0.05)]


class Told(NamedTuple):
    """What the fulcrum estimator said last: where it is, and sigma of its depth, m."""

    p: Vector
    sigma: float


class State(NamedTuple):
    """What is remembered: the smooth tip force, and since when it is over or under."""

    f: Vector
    contact: float
    lasted: float


_PARTS = np.cumsum([size(State), 3])
_MEMORY = size(State) + 3 + 9
"""Elements of the memory: `State`, k and c, and their covariance."""


@dataclass
class TipLoadParams:
    """How tip and wall are told apart."""

    active: bool = parameter(False, "if not, the wall's is all of it")
    length: float = parameter(
        0.4, "L, from the sensor to the tip", "m", above=0, most=1
    )
    force_noise: float = parameter(
        0.05, "of the sensor, each axis", "N", above=0, most=5
    )
    moment_noise: float = parameter(
        0.005, "of the sensor, each axis", "N m", above=0, most=1
    )
    smooth: float = parameter(
        0.02, "time constant of the tip's force", "s", above=0, most=1
    )
    touch: float = parameter(
        0.2, "force from which something touches", "N", above=0, most=5
    )
    touch_time: float = parameter(0.025, "if it lasts so long", "s", least=0, most=1)
    release_time: float = parameter(
        0.1, "that half of it is not reached before nothing does", "s", least=0, most=1
    )
    first_stiffness: float = parameter(
        0.5, "k may be as much at first", "N m/rad", least=0, most=5
    )
    torque_drift: float = parameter(
        0.004, "random walk of c", "N m/sqrt(s)", least=0, most=1
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


@compiled
def tilt(u: Vector) -> Vector:
    """The rotation from the wall's normal to the shaft, as a vector in rad."""
    axis = cross(_NORMAL, u)
    sine = norm(axis)
    if sine < 1e-9:
        return 0.0, 0.0, 0.0
    return scaled(acos(min(1.0, max(-1.0, dot(_NORMAL, u)))) / sine, axis)


@compiled
def regressor(u: Vector, e: Vector) -> np.ndarray:
    """Of the torque along e by k and c (x and y in W), (3)."""
    return np.array((-dot(tilt(u), e), e[0], e[1]))


@compiled
def learnt(
    c: Any, x: np.ndarray, P: np.ndarray, u: Vector, r: Vector, variance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The torque's k and c (3), and their covariance (3, 3), after one reading."""
    for e in lateral_basis(u):
        h = regressor(u, e)
        gain = P @ h / (h @ P @ h + variance)
        x = x + gain * (dot(r, e) - h @ x)
        P = P - np.outer(gain, h @ P)
    return x, P


@compiled
def separate(
    c: Any,
    old: State,
    x: np.ndarray,
    P: np.ndarray,
    told: Told,
    shaft: ShaftMotion,
    wrench: Wrench,
) -> tuple[State, np.ndarray, np.ndarray, Wrench, TipForce]:
    """One reading: what is remembered, k and c, the wall's share and the tip's.

    Args:
        c: A record of the parameters.
        old: What was remembered.
        x: k in N m/rad and c in N m (3).
        P: Their covariance (3, 3).
        told: What the estimator said last.
        shaft: As the encoders have it.
        wrench: What acts on the shaft.
    """
    nothing = TipForce((0.0, 0.0, 0.0), 0.0, x[0], 0.0)
    sound = finite_shaft(shaft) and wrench.valid > 0.5 and finite_wrench(wrench)
    if c.active < 0.5 or not sound:
        still = State((0.0, 0.0, 0.0), 0.0, 0.0)
        return still, x, P, wrench, nothing
    u, f = shaft.u, across(wrench.f, shaft.u)
    depth = dot(u, sub(told.p, shaft.p))
    arm = max(c.length - depth, 0.03)
    r = across(along(wrench.m, -depth, cross(u, f)), u)
    e1, e2 = lateral_basis(u)
    h1, h2 = regressor(u, e1), regressor(u, e2)
    torque = along(scaled(h1 @ x, e1), h2 @ x, e2)
    unsure = 0.5 * (h1 @ P @ h1 + h2 @ P @ h2)  # of each axis of the torque
    doubt = (norm(f) * told.sigma) ** 2
    tip = scaled(-1.0 / arm, cross(u, sub(r, torque)))
    share = 1.0 - exp(-c.period / c.smooth)
    smooth = along(across(old.f, u), share, sub(tip, across(old.f, u)))
    noise = c.moment_noise**2 + (depth * c.force_noise) ** 2
    margin = c.touch + 3.0 * sqrt(unsure + doubt) / arm
    contact, lasted = old.contact, old.lasted
    if contact < 0.5:
        lasted = lasted + c.period if norm(smooth) > margin else 0.0
        if lasted > c.touch_time:
            contact, lasted = 1.0, 0.0
    else:
        lasted = lasted + c.period if norm(smooth) < 0.5 * margin else 0.0
        if lasted > c.release_time:
            contact, lasted = 0.0, 0.0
    P = P.copy()
    P[0, 0] += c.period * (0.25 * c.torque_drift) ** 2
    P[1, 1] += c.period * c.torque_drift**2
    P[2, 2] += c.period * c.torque_drift**2
    quiet = norm(smooth) < 0.6 * margin or unsure > (0.5 * c.touch * arm) ** 2
    if contact < 0.5 and norm(f) < _SMALL and quiet:
        x, P = learnt(c, x, P, u, r, noise + doubt)
    m = sub(wrench.m, torque)
    if contact < 0.5:
        wall = Wrench(wrench.f, m, wrench.valid)
        return State(smooth, contact, lasted), x, P, wall, nothing
    wall = Wrench(
        sub(wrench.f, smooth), along(m, -c.length, cross(u, smooth)), wrench.valid
    )
    sigma = sqrt(0.5 * share * noise + unsure + doubt) / arm
    felt = TipForce(smooth, 1.0, x[0], sigma)
    return State(smooth, contact, lasted), x, P, wall, felt


@compiled
def _step(
    c: Any,
    old: State,
    x: np.ndarray,
    P: np.ndarray,
    told: Told,
    shaft: ShaftMotion,
    wrench: Wrench,
) -> tuple[State, np.ndarray, np.ndarray, Wrench, TipForce]:
    state, x, P, wall, tip = separate(c, old, x, P.reshape((3, 3)), told, shaft, wrench)
    return state, x, P.copy().reshape(9), wall, tip


class TipLoad(StepBlock):
    """Parts the wrist's wrench into the wall's and the tip's.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` of the sensor.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`; that of the instant
    before is used, since the estimate in turn is made of the wall's share.

    Port ``wall`` emits the `Wrench` of the wall at the fulcrum alone.

    Port ``tip_force`` emits the `TipForce`.
    """

    def __init__(
        self, params: TipLoadParams | None = None, guess: Any = (0.0, 0.0, 0.0)
    ) -> None:
        """Makes the block, the fulcrum guessed at p_WI [m]."""
        super().__init__()
        params = check(params or TipLoadParams())
        self._constants = packed(params)
        self._shaft = self.signal_in("shaft", ShaftMotion)
        self._wrench = self.signal_in("wrench", Wrench)
        self._estimate = self.signal_in("estimate", Fulcrum)
        k, c = params.first_stiffness, 0.1
        P = np.diag([k * k + 1e-12, c * c, c * c])
        untouched = State((0.0, 0.0, 0.0), 0.0, 0.0)
        self.DeclareDiscreteState([*flat(untouched), *np.zeros(3), *P.ravel()])
        self.DeclareDiscreteState([*guess, 0.02])
        self._run = wired(
            _step,
            1,
            [State, 3, 9, Told],
            [ShaftMotion, Wrench],
            [State, 3, 9, Wrench, TipForce],
            False,
        )
        reads = {self.xd_ticket(), self._shaft.ticket(), self._wrench.ticket()}
        self._next = self.cached("next", self._calc_next, reads)
        self._emit(
            self._next.Eval,
            {self._next.ticket()},
            {"wall": Wrench, "tip_force": TipForce},
            _MEMORY,
        )
        self.update_every(params.period, self._calc_update)

    def _calc_next(self, context: Any) -> np.ndarray:
        state = context.get_discrete_state(0).value()
        parts = np.split(state, _PARTS)
        told = context.get_discrete_state(1).value()
        after: np.ndarray = self._run(
            self._constants,
            *parts,
            told,
            self._shaft.Eval(context),
            self._wrench.Eval(context),
        )
        return after

    def _calc_update(self, context: Any) -> list[np.ndarray]:
        told = view(Fulcrum, self._estimate.Eval(context))
        known = self.finite_or_kept(context, 1, [*told.p, told.sigma_along])
        return [self._next.Eval(context)[:_MEMORY], known]
