"""Touch watch: whether a tool pushes the robot's shaft, how hard, and how far down.

The wrist's sensor feels the wall at the fulcrum and, if another tool comes, that one d
below it. Of the smooth force f and moment m across the shaft, with the fulcrum's depth
lambda from the sensor, no force of the wall's explains

    r = m - lambda u x f = d u x f_t,

f_t being the push. A wall that breathes leaves no r but that of a depth that is not
quite known, however far it goes; a push leaves one that is clear of it and of the
noise, and is over when there is none left. The slow mean of r does not count.

An estimator of the fulcrum would take a push's first newton for a jump of the wall, and
learn from it a depth at which nothing can be told any more. So lambda is that of
before, which goes on as the estimator has it move; and the estimator is told nothing
while a moment may be a push's, or the force has jumped, until it is known what it is.

A push is what exceeds the wall's pull at the predicted fulcrum, f_t = f - f_w, and
tells d = r . (u x f_t) / |f_t|^2 (a Kalman filter of one number). With d the moment
alone parts the two, f_t = r x u / d: where that is surer than the prediction, what is
left is told to the estimator, and a wall that moves during the push is followed.
A push so near to the trocar that its moment cannot be told is the wall's.

A wrist that unloads the wall makes f zero while both push: there only r is left of it.
Where the tracker has a tool beside the shaft, d is known before it pushes, and r tells
the push by itself.
"""

from dataclasses import dataclass
from math import exp, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    along,
    cross,
    dot,
    limited,
    norm,
    plus,
    scaled,
    sub,
)
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, finiteness, flat, size, view
from systems.common.signals import (
    Fulcrum,
    Guide,
    Permission,
    ShaftMotion,
    Wrench,
    finite_guide,
)
from systems.common.step_block import StepBlock, wired
from systems.common.stops import Stop
from systems.sensing.wrench_kernel import SILENCE

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)
_STILL = (0.0, 0.0, 0.0)
_PROBING = float(Stop.PROBING)
_FAR = 1.0
"""Of a tool that is not there, m."""


class Touched(NamedTuple):
    """What pushes the shaft."""

    f: Annotated[Vector, Field("N", "on the shaft, across it", (0.6, 0.0, 0.0))]
    share: Annotated[float, Field("1", "where: 0 at the fulcrum, 1 at the tip", 0.6)]
    touched: Annotated[float, Field("1", "1 while something does, else 0", 1.0)]


class Past(NamedTuple):
    """What is remembered.

    The smooth force and moment left, N and N m; their slow means, and that of the
    fulcrum, m; by how far the estimator's is taken to be wrong, m; how far below it is
    pushed, m, and its variance, m^2; whether something pushes; for how long a moment
    is kept back, and how long there is none left, s; 1 while b and d are kept.
    """

    f: Vector
    r: Vector
    f_0: Vector
    r_0: Vector
    p_0: Vector
    b: Vector
    d: float
    var_d: float
    touched: float
    held: float
    free: float
    kept: float


class Waits(NamedTuple):
    """1 while the estimator is told nothing, else 0."""

    waits: float


class Told(NamedTuple):
    """What the estimator said last: the fulcrum, m and m/s; its sigmas, m; K, N/m.

    And 1 if it is known, else 0; where a tool is nearest to the shaft, m, and how near.
    """

    p: Vector
    v: Vector
    sigma_across: float
    sigma_along: float
    stiffness: float
    known: float
    M_R: Vector
    rho: float


_NOTHING_TOLD = Told(_STILL, _STILL, 0.0, 0.0, 1.0, 0.0, _STILL, _FAR)


@dataclass
class TouchWatchParams:
    """From when on something is said to push."""

    least: float = parameter(0.4, "force from which it does", "N", above=0, most=10)
    sure: float = parameter(
        4.0, "standard deviations of its moment, at the least", least=0, most=20
    )
    depth: float = parameter(
        0.01, "by which the fulcrum's may be wrong", "m", above=0, most=0.1
    )
    smooth: float = parameter(
        0.03, "time constant of the wrench", "s", above=0, most=0.5
    )
    slow: float = parameter(0.5, "of that before", "s", above=0, most=10)
    suspect: float = parameter(
        3.5, "standard deviations from which it is kept back", least=0, most=20
    )
    hold: float = parameter(0.3, "for so long at the most", "s", least=0, most=2)
    sudden: float = parameter(
        0.6, "jump of the force that is kept back", "N", above=0, most=5
    )
    brief: float = parameter(0.06, "for so long without a moment", "s", least=0, most=2)
    below: float = parameter(
        0.06, "where a push is expected, with that deviation", "m", above=0, most=0.3
    )
    beside: float = parameter(
        0.007, "axes of a tool that may be pushing", "m", least=0, most=0.05
    )
    place: float = parameter(
        0.008, "deviation of where it would", "m", above=0, most=0.1
    )
    sure_beside: float = parameter(
        1.5, "for `sure` and `suspect` while one is there", least=0, most=20
    )
    nearest: float = parameter(
        0.02, "below which its share is not told", "m", above=0, most=0.3
    )
    release: float = parameter(
        0.1, "without a moment, after which it is over", "s", least=0, most=2
    )
    known: float = parameter(
        0.3, "sigma of ln K up to which the fulcrum is known", above=0, most=3
    )
    length: float = parameter(0.4, "from sensor to tip", "m", above=0, most=1)
    force_noise: float = parameter(
        0.05, "of the sensor, each axis", "N", above=0, most=5
    )
    moment_noise: float = parameter(
        0.005, "of the sensor, each axis", "N m", above=0, most=1
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


@compiled
def moment_left(p: Vector, shaft: ShaftMotion, wrench: Wrench) -> tuple[Vector, float]:
    """r, N m: what no force at p_WI explains of a wrench; and its depth, m."""
    depth = dot(shaft.u, sub(p, shaft.p))
    f = across(wrench.f, shaft.u)
    return across(along(wrench.m, -depth, cross(shaft.u, f)), shaft.u), depth


@compiled
def placed(
    c: Any, d: float, var_d: float, lever: Vector, r: Vector, doubt: float
) -> tuple[float, float]:
    """How far below the fulcrum it pushes, and the variance, after one reading.

    Args:
        c: A record of the parameters.
        d: How far before, m.
        var_d: Its variance, m^2.
        lever: u x f of the push, N.
        r: Moment left, N m.
        doubt: Standard deviation of r, N m.
    """
    size = norm(lever)
    gain = var_d * size / (var_d * size * size + doubt * doubt)
    d += gain * (dot(r, lever) / max(size, 1e-9) - d * size)
    return max(d, 0.0), var_d * (1.0 - gain * size)


@compiled
def at_fulcrum(f: Vector, depth: float, u: Vector, df: Vector, dm: Vector) -> Wrench:
    """A force across the shaft at the fulcrum's depth, with its noise, as a reading."""
    return Wrench(plus(f, df), plus(scaled(depth, cross(u, f)), dm), 1.0)


@compiled
def watch_touch(
    c: Any, past: Past, told: Told, shaft: ShaftMotion, wrench: Wrench
) -> tuple[Past, Wrench, Touched, Wrench, Waits]:
    """One reading: what is remembered, the wall's share, what pushes, who waits.

    Args:
        c: A record of the parameters; `part` and `slow_part`, what a reading counts;
            `rest`, how much noise is left in the smooth.
        past: What was remembered.
        told: What the estimator said.
        shaft: As the encoders have it.
        wrench: What acts on the shaft.
    """
    nothing = Touched(_STILL, 1.0, 0.0)
    if not finite_shaft(shaft) or wrench.valid < 0.5 or not finite_wrench(wrench):
        return past, wrench, nothing, wrench, Waits(0.0)
    u = shaft.u
    p_0 = past.p_0 if told.known > 0.5 else told.p
    r, depth = moment_left(p_0, shaft, wrench)
    force = across(wrench.f, u)
    f = along(past.f, c.part, sub(force, past.f))
    r = along(past.r, c.part, sub(r, past.r))
    if told.known < 0.5:
        # What the force still does when the probe ends is no jump: as if kept back.
        after = Past(f, r, f, r, p_0, _STILL, c.below, 0.0, 0.0, c.brief, 0.0, 0.0)
        return after, wrench, nothing, wrench, Waits(0.0)
    left = sub(r, past.r_0)
    noise = sqrt(c.moment_noise**2 + (depth * c.force_noise) ** 2)
    doubt = c.rest * noise
    p = along(told.p, c.period, told.v)
    pull = scaled(told.stiffness, across(sub(p, shaft.p), u))
    b, d, var_d = past.b, past.d, past.var_d
    p_0 = along(p_0, c.period, told.v)
    if past.kept < 0.5:
        b = scaled(1.0 / told.stiffness, sub(past.f_0, pull))
        d, var_d = c.below, c.below**2
    wall = along(pull, told.stiffness, across(b, u))
    push = sub(f, wall)
    sure, suspect, loaded = c.sure, c.suspect, norm(push)
    where = dot(u, sub(told.M_R, p_0))
    if told.rho < c.beside and where > c.nearest:
        sure, suspect, loaded = c.sure_beside, c.sure_beside, norm(f)
        d, var_d = where, c.place**2
        push = scaled(-1.0 / d, cross(u, left))
        moment = norm(left)
    else:
        lever = cross(u, push)
        d, var_d = placed(
            c, d, var_d, lever, left, noise + d * told.stiffness * told.sigma_across
        )
        moment = dot(left, lever) / max(norm(lever), 1e-9)
    wrong = max(c.depth, told.sigma_along) * loaded
    margin = wrong + sure * doubt
    touched, free, held = past.touched, 0.0, past.held
    if touched > 0.5:
        if moment < 0.5 * margin or norm(push) < 0.5 * c.least:
            free = past.free + c.period
            touched = 1.0 if free < c.release else 0.0
    elif norm(push) > c.least and moment > margin:
        touched = 1.0
    change = norm(sub(force, wall))
    doubtful = moment - wrong > suspect * doubt and norm(push) > 0.5 * c.least
    if doubtful or norm(sub(force, past.f)) > c.sudden:
        held += c.period
    elif change < 0.5 * c.sudden:
        held = 0.0
    elif held > 0.0:
        held += c.period
    limit = c.hold if doubtful else c.brief
    if touched < 0.5 and not 0.0 < held < limit:
        f_0 = along(past.f_0, c.slow_part, sub(force, past.f_0))
        if past.touched > 0.5:
            f_0, held = wall, 0.0
        r_0 = along(past.r_0, c.slow_part, left)
        p_0 = along(p_0, c.slow_part, sub(told.p, p_0))
        after = Past(f, r, f_0, r_0, p_0, _STILL, c.below, 0.0, 0.0, held, 0.0, 0.0)
        return after, wrench, nothing, wrench, Waits(0.0)
    # Its noise stays: a sensor without is not believed.
    own_f = limited(sub(force, f), 2.0 * c.force_noise)
    smooth_m = along(r, depth, cross(u, f))
    own_m = limited(sub(across(wrench.m, u), smooth_m), 2.0 * c.moment_noise)
    seen = at_fulcrum(wall, depth, u, own_f, own_m)
    if touched < 0.5:
        after = Past(f, r, past.f_0, past.r_0, p_0, b, d, var_d, 0.0, held, 0.0, 1.0)
        return after, seen, nothing, seen, Waits(1.0)
    # With where it pushes known the moment tells the push, and what is left the wall.
    by_moment = scaled(-1.0 / max(d, c.nearest), cross(u, left))
    sigma = sqrt(doubt**2 + var_d * dot(by_moment, by_moment)) / max(d, c.nearest)
    tells = d > c.nearest and sigma < told.stiffness * told.sigma_across
    rest = seen
    if tells:
        rest = at_fulcrum(sub(f, by_moment), depth, u, own_f, own_m)
        b = along(b, -c.part, b)
    after = Past(f, r, past.f_0, past.r_0, p_0, b, d, var_d, touched, held, free, 1.0)
    reach = max(c.length - depth, 1e-3)
    share = min(1.0, max(0.0, d / reach))
    touch = Touched(push, share, 1.0)
    return after, seen, touch, rest, Waits(0.0 if tells else 1.0)


class TouchWatch(StepBlock):
    """Says whether a tool pushes the robot's, and keeps its push from the wall's.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` of the sensor.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`, and port ``permission``
    the passive wrist's `Permission`: while it probes nothing is known; port ``guide``
    accepts the planner's `Guide`: which tool is near, and where. Those of the instant
    before are used, since they in turn are made of the wall's share.

    Port ``believed`` accepts what of ``wall`` is believed.

    Port ``wall`` emits the `Wrench` of the wall alone.

    Port ``touch`` emits what is `Touched`.

    Port ``told`` emits what is believed to an estimator: silence where it must predict.
    """

    def __init__(self, params: TouchWatchParams | None = None) -> None:
        """Makes the block; raises ParameterError for a value out of range."""
        super().__init__()
        params = check(params or TouchWatchParams())
        part = 1.0 - exp(-params.period / params.smooth)
        slow = 1.0 - exp(-params.period / params.slow)
        constants = packed(
            params, part=part, slow_part=slow, rest=sqrt(part / (2.0 - part))
        )
        ports = [
            self.signal_in(name, kind)
            for name, kind in (("shaft", ShaftMotion), ("wrench", Wrench))
        ]
        estimate = self.signal_in("estimate", Fulcrum)
        permission = self.signal_in("permission", Permission)
        guide = self.signal_in("guide", Guide)
        believed = self.signal_in("believed", Wrench)
        silence = flat(SILENCE)
        outputs = {"wall": Wrench, "touch": Touched}
        gives = [Past, *outputs.values(), Wrench, Waits]
        taken = [ShaftMotion, Wrench]
        run = wired(watch_touch, 1, [Past, Told], taken, gives, False)
        self.DeclareDiscreteState(np.zeros(size(Past)))
        self.DeclareDiscreteState(flat(_NOTHING_TOLD))

        def calc(context: Any) -> np.ndarray:
            states = [context.get_discrete_state(k).value() for k in range(2)]
            return run(constants, *states, *[port.Eval(context) for port in ports])

        reads = {self.xd_ticket(), *(port.ticket() for port in ports)}
        step = self.cached("step", calc, reads)
        last = size(Past)
        self._emit(step, outputs, last)
        begin = last + size(Wrench)
        felt = slice(begin, begin + size(Touched))
        rest = slice(felt.stop, felt.stop + size(Wrench))

        def calc_told(context: Any) -> np.ndarray:
            array = step.Eval(context)
            if view(Waits, array[rest.stop :]).waits > 0.5:
                return silence
            # What is not believed is not told, whatever of it is the wall's.
            trusted = believed.Eval(context)
            touched = view(Touched, array[felt]).touched > 0.5
            valid = view(Wrench, trusted).valid > 0.5
            return array[rest] if touched and valid else trusted

        self.signal_out("told", Wrench, calc_told, {step.ticket(), believed.ticket()})

        def update(context: Any) -> list[np.ndarray]:
            said = view(Fulcrum, estimate.Eval(context))
            probes = view(Permission, permission.Eval(context)).code == _PROBING
            known = not probes and said.sigma_ln_stiffness < params.known
            near = view(Guide, guide.Eval(context))
            told = Told(
                said.p,
                said.v,
                said.sigma_across,
                said.sigma_along,
                said.stiffness,
                float(known),
                near.M_R,
                near.rho if finite_guide(near) else _FAR,
            )
            return [step.Eval(context)[:last], flat(told)]

        self.update_every(params.period, update)
