"""Wrench watch: whether the wrist's sensor can be believed.

The wall pushes the shaft sideways at the fulcrum, so that of a sound sensor's reading

- the moment is that of the force at the fulcrum's depth, m = lambda u x f;
- the noise is never still: a frozen reading's is;
- the force falls, on average, while the shaft moves along it: over the last samples
  sum df . ds = -K sum ds . ds, ds being the motion across the shaft at the fulcrum.
  A reading of the wrong sign has +K, and a wrist that trusts it runs away.

What breaks one of the first two is silence to who listens, as long as it does. A sensor
that answers motion with the wrong sign is not believed until the arm, which gives way
meanwhile, has gone where the reading points: the wall's true force moves it. So a wall
that moves faster than the shaft, which looks like a wrong sign, is told from one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt
from typing import Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, cross, dot, norm, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Vector, finiteness, vector
from systems.common.signals import ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.sensing.wrench_kernel import SILENCE

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)


@dataclass
class WrenchWatchParams:
    """What a sound sensor's reading is like."""

    force_noise: float = parameter(
        0.05, "of the sensor, each axis; 0 tells nothing", "N", least=0, most=5
    )
    still: float = parameter(
        0.03, "share of the noise's power below which it is frozen", least=0, most=0.5
    )
    still_time: float = parameter(
        0.04, "time constant of that power", "s", above=0, most=1
    )
    neighbourhood: float = parameter(
        0.08, "of the guess, in which the fulcrum is", "m", above=0, most=0.3
    )
    moment: float = parameter(
        0.1, "that the force does not explain, at the most", "N m", above=0, most=5
    )
    share: float = parameter(
        0.1, "more of that, of the force times its depth", least=0, most=1
    )
    answer_force: float = parameter(
        1.5, "force from which its answer to motion counts", "N", above=0, most=20
    )
    answer_time: float = parameter(
        0.15, "time constant of the answer's sums", "s", above=0, most=2
    )
    answer_travel: float = parameter(
        3e-4, "root of the summed squares of motion", "m", above=0, most=0.05
    )
    step: float = parameter(
        2.0, "of a sample, from which it is the wall's own", "N", above=0, most=50
    )
    softest: float = parameter(
        50.0, "wall, K, that a wrong answer must show", "N/m", above=0, most=2e4
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


class Watched(NamedTuple):
    """Of the last reading, over the last ones, and of the largest not believed."""

    f: Vector
    p: Vector
    noise: float
    answer: float
    travel: float
    liar: float
    f_0: Vector
    p_0: Vector


@compiled
def explained(c: Any, shaft: ShaftMotion, wrench: Wrench) -> bool:
    """Whether the moment is that of the force at a depth near the fulcrum's."""
    arm = cross(shaft.u, wrench.f)
    square = dot(arm, arm)
    depth = dot(shaft.u, sub(c.guess, shaft.p))
    nearest = depth
    if square > 0.0:
        nearest = dot(arm, wrench.m) / square
        nearest = min(max(nearest, depth - c.neighbourhood), depth + c.neighbourhood)
    left = across(along(wrench.m, -nearest, arm), shaft.u)
    return norm(left) <= c.moment + c.share * abs(depth) * sqrt(square)


@compiled
def yielded(c: Any, df: Vector, ds: Vector, f: Vector) -> bool:
    """Whether an arm that gives way went along the force f, which fell by that."""
    travel = dot(ds, ds)
    sure = 5.0 * sqrt(0.5 * c.power * travel)
    falls = dot(df, ds) < -max(c.softest * travel, sure)
    return falls and travel > c.answer_travel**2 and dot(ds, f) > 0.0


@compiled
def watch(
    c: Any, old: Watched, shaft: ShaftMotion, wrench: Wrench
) -> tuple[Watched, Wrench]:
    """The next memory, and the reading if it can be believed, else silence."""
    sound = finite_shaft(shaft) and wrench.valid > 0.5 and finite_wrench(wrench)
    if not sound or not explained(c, shaft, wrench):
        kept = (old.liar, old.f_0, old.p_0)
        return Watched(old.f, old.p, 1.0, 0.0, 0.0, *kept), SILENCE
    depth = dot(shaft.u, sub(c.guess, shaft.p))
    f, p = across(wrench.f, shaft.u), along(shaft.p, depth, shaft.u)
    df, ds = sub(f, old.f), across(sub(p, old.p), shaft.u)
    noise = old.noise
    if c.power > 0.0:
        noise += c.fresh * (dot(df, df) / c.power - noise)
    keep = c.keep if norm(df) < c.step else 0.0
    answer = keep * (old.answer + dot(df, ds))
    travel = keep * (old.travel + dot(ds, ds))
    sure = 5.0 * sqrt(c.power * travel)  # what noise alone makes of it
    wrong = answer > max(c.softest * travel, sure) and norm(f) > c.answer_force
    liar = 1.0 if wrong and travel > c.answer_travel**2 else old.liar
    f_0, p_0 = old.f_0, old.p_0
    if old.liar == 0.0 or norm(f) > norm(f_0) or dot(f, f_0) <= 0.0:
        f_0, p_0 = f, p
    elif yielded(c, sub(f, f_0), across(sub(p, p_0), shaft.u), f_0):
        liar = answer = travel = 0.0
    state = Watched(f, p, noise, answer, travel, liar, f_0, p_0)
    if liar > 0.0 or noise < c.still:
        return state, SILENCE
    return state, wrench


class WrenchWatch(StepBlock):
    """Passes on the wrist's readings that can be believed; else silence.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` as the sensor tells it.

    Port ``believed`` emits the `Wrench`.
    """

    def __init__(
        self,
        params: WrenchWatchParams | None = None,
        guess: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Makes the block, the fulcrum guessed at p_WI [m]."""
        super().__init__()
        params = check(params or WrenchWatchParams())
        still = (0.0, 0.0, 0.0)
        self.declare_step(
            watch,
            [
                packed(
                    params,
                    guess=vector(guess),
                    power=4.0 * params.force_noise**2,  # of a difference, two axes
                    fresh=1.0 - exp(-params.period / params.still_time),
                    keep=exp(-params.period / params.answer_time),
                )
            ],
            {"shaft": ShaftMotion, "wrench": Wrench},
            Watched(still, still, 1.0, 0.0, 0.0, 0.0, still, still),
            {"believed": Wrench},
            params.period,
            timed=False,
        )
