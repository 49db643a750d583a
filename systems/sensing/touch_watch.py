"""Touch watch: whether a tool pushes the robot's shaft, how hard, and how far down.

The wrist's sensor feels the wall at the fulcrum and, if another tool comes, that one
below it. What has changed of its smooth wrench against what it was before, f and m
across the shaft, tells where it acts: with the fulcrum's depth lambda from the sensor

    r = m - lambda u x f = d u x f,

d being how far below the fulcrum. A wall that moves leaves no r but that of a depth
that is not quite known; a push leaves one that is clear of it and of the noise, and is
over when there is none left. While it lasts, the wall is taken to bear what it bore
before: the shaft goes through the fulcrum that is believed.

An estimator of the fulcrum would take a push's first newton for a jump of the wall, and
learn from it a depth at which nothing can be told any more. So it is told nothing when
a force comes of a sudden, until it is known what it is, nor all the time if it is a
push: it predicts. What the wall does meanwhile is taken for the push, and a push so
near to the trocar that its moment cannot be told is the wall's.
"""

from dataclasses import dataclass
from math import exp, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, cross, dot, limited, norm, plus, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, finiteness, flat, size, view
from systems.common.signals import Fulcrum, Permission, ShaftMotion, Wrench
from systems.common.step_block import StepBlock, wired
from systems.common.stops import Stop
from systems.sensing.wrench_kernel import SILENCE

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)
_STILL = (0.0, 0.0, 0.0)
_PROBING = float(Stop.PROBING)


class Touched(NamedTuple):
    """What pushes the shaft."""

    f: Annotated[Vector, Field("N", "on the shaft, across it", (0.6, 0.0, 0.0))]
    share: Annotated[float, Field("1", "where: 0 at the fulcrum, 1 at the tip", 0.6)]
    touched: Annotated[float, Field("1", "1 while something does, else 0", 1.0)]


class Past(NamedTuple):
    """What is remembered.

    The smooth wrench and the one before, N and N m; the fulcrum that was believed, m;
    whether something pushes; how long a sudden force is kept back, and how long there
    is no push left, s.
    """

    f: Vector
    m: Vector
    f_0: Vector
    m_0: Vector
    p: Vector
    touched: float
    held: float
    free: float


class Waits(NamedTuple):
    """1 while the estimator is told nothing, else 0."""

    waits: float


class Told(NamedTuple):
    """The fulcrum that the estimator said last, m; 1 if it is known, else 0."""

    p: Vector
    known: float


@dataclass
class TouchWatchParams:
    """From when on something is said to push."""

    least: float = parameter(0.4, "force from which it does", "N", above=0, most=10)
    sure: float = parameter(
        5.0, "standard deviations of its moment, at the least", least=0, most=20
    )
    depth: float = parameter(
        0.01, "by which the fulcrum's may be wrong", "m", above=0, most=0.1
    )
    smooth: float = parameter(
        0.03, "time constant of the wrench", "s", above=0, most=0.5
    )
    slow: float = parameter(0.5, "of that before", "s", above=0, most=10)
    sudden: float = parameter(
        0.25, "change of the force that is kept back", "N", above=0, most=5
    )
    hold: float = parameter(0.3, "for so long at the most", "s", least=0, most=2)
    wall: float = parameter(
        1.0, "force from which no moment means the wall", "N", above=0, most=20
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
def place(
    c: Any, past: Past, f: Vector, m: Vector, shaft: ShaftMotion
) -> tuple[Vector, float, float, float]:
    """Of a smooth wrench: what has changed, how far below the fulcrum, moment, margin.

    Args:
        c: A record of the parameters; `rest`, how much noise is left in it.
        past: With which it is compared.
        f: Its force, N.
        m: Its moment, N m.
        shaft: As the encoders have it.
    """
    u = shaft.u
    depth = dot(u, sub(past.p, shaft.p))
    change = across(sub(f, past.f_0), u)
    lever = cross(u, change)
    r = across(along(sub(m, past.m_0), -depth, lever), u)
    square = max(dot(lever, lever), 1e-12)
    noise = sqrt(c.moment_noise**2 + (depth * c.force_noise) ** 2)
    margin = c.depth * sqrt(square) + c.sure * c.rest * noise
    return change, dot(r, lever) / square, norm(r), margin


@compiled
def watch_touch(
    c: Any, past: Past, told: Told, shaft: ShaftMotion, wrench: Wrench
) -> tuple[Past, Wrench, Touched, Waits]:
    """One reading: what is remembered, the wall's share, what pushes, who waits.

    Args:
        c: As `place` has it; `part` and `slow_part`, what a reading counts.
        past: What was remembered.
        told: What the estimator said.
        shaft: As the encoders have it.
        wrench: What acts on the shaft.
    """
    nothing = Touched(_STILL, 1.0, 0.0)
    if not finite_shaft(shaft) or wrench.valid < 0.5 or not finite_wrench(wrench):
        return past, wrench, nothing, Waits(0.0)
    if told.known < 0.5:
        f, m = wrench.f, wrench.m
        return Past(f, m, f, m, told.p, 0.0, 0.0, 0.0), wrench, nothing, Waits(0.0)
    f = along(past.f, c.part, sub(wrench.f, past.f))
    m = along(past.m, c.part, sub(wrench.m, past.m))
    change, below, moment, margin = place(c, past, f, m, shaft)
    touched, free = past.touched, 0.0
    if touched < 0.5 and norm(change) > c.least and below > 0.0 and moment > margin:
        touched = 1.0
    elif touched > 0.5 and (moment < 0.5 * margin or norm(change) < 0.5 * c.least):
        free = past.free + c.period
        touched = 1.0 if free < c.release else 0.0
    now = norm(across(sub(wrench.f, past.f_0), shaft.u))
    held = past.held + c.period if now > c.sudden or past.held > 0.0 else 0.0
    if norm(change) > c.wall and moment < 0.5 * margin:
        held = max(held, c.hold)
    if touched < 0.5 and not 0.0 < held < c.hold:
        f_0 = along(past.f_0, c.slow_part, sub(wrench.f, past.f_0))
        m_0 = along(past.m_0, c.slow_part, sub(wrench.m, past.m_0))
        held = 0.0 if now < 0.5 * c.sudden else held
        after = Past(f, m, f_0, m_0, told.p, 0.0, held, 0.0)
        return after, wrench, nothing, Waits(0.0)
    wall = Wrench(
        plus(past.f_0, limited(sub(wrench.f, f), 2.0 * c.force_noise)),
        plus(past.m_0, limited(sub(wrench.m, m), 2.0 * c.moment_noise)),
        wrench.valid,
    )
    after = Past(f, m, past.f_0, past.m_0, past.p, touched, held, free)
    if touched < 0.5:
        return after, wall, nothing, Waits(1.0)
    reach = max(c.length - dot(shaft.u, sub(past.p, shaft.p)), 1e-3)
    share = min(1.0, max(0.0, below / reach))
    return after, wall, Touched(change, share, 1.0), Waits(1.0)


class TouchWatch(StepBlock):
    """Says whether a tool pushes the robot's, and keeps its push from the wall's.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` of the sensor.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`, and port ``permission``
    the passive wrist's `Permission`: while it probes nothing is known. Those of the
    instant before are used, since they in turn are made of the wall's share.

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
        believed = self.signal_in("believed", Wrench)
        silence = flat(SILENCE)
        outputs = {"wall": Wrench, "touch": Touched}
        gives = [Past, *outputs.values(), Waits]
        taken = [ShaftMotion, Wrench]
        run = wired(watch_touch, 1, [Past, Told], taken, gives, False)
        past = Past(_STILL, _STILL, _STILL, _STILL, _STILL, 0.0, 0.0, 0.0)
        self.DeclareDiscreteState(flat(past))
        self.DeclareDiscreteState(flat(Told(_STILL, 0.0)))

        def calc(context: Any) -> np.ndarray:
            states = [context.get_discrete_state(k).value() for k in range(2)]
            return run(constants, *states, *[port.Eval(context) for port in ports])

        reads = {self.xd_ticket(), *(port.ticket() for port in ports)}
        step = self.cached("step", calc, reads)
        last = size(Past)
        self._emit(step, outputs, last)

        def calc_told(context: Any) -> np.ndarray:
            array = step.Eval(context)
            return silence if array[-1] > 0.5 else believed.Eval(context)

        self.signal_out("told", Wrench, calc_told, {step.ticket(), believed.ticket()})

        def update(context: Any) -> list[np.ndarray]:
            said = view(Fulcrum, estimate.Eval(context))
            probes = view(Permission, permission.Eval(context)).code == _PROBING
            known = not probes and said.sigma_ln_stiffness < params.known
            return [step.Eval(context)[:last], np.array([*said.p, float(known)])]

        self.update_every(params.period, update)
