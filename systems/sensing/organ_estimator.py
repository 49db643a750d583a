"""Organ estimator: where a point of an organ is now, learnt from breath to breath.

What the tracker delivers is 20 to 50 ms old, in which an organ moves by half a
millimetre. Breathing repeats itself, but no breath is like the other: it is longer or
shorter, deeper or shallower. The estimate is a template of the breath, the mean over
the last breaths in bins of their phase, read at the phase of now,

    p(t) = b + d T(phi(t)),   phi' = omega,

b being an offset and d the depth of this breath. An extended Kalman filter finds phi,
omega, d and b within the breath; omega and d tend to the usual, which is learnt as the
template is, with how far breaths differ. The first template is made from a record of
some seconds, with the rate that `breathing_rate` finds in it.

A cough or a breath that stops shows as frames that do not fit a breath of whatever
length and depth: *alarm*. The estimate is then the plain track of the frames, nothing
is learnt, and the record is searched for the breath that fits again.
"""

from dataclasses import dataclass
from math import floor
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, example, reader
from systems.common.signals import TrackedShaft
from systems.passive_wrist.breathing_rate import find_breathing, fit_breathing
from systems.sensing.breath_filter import (
    ALARM,
    AWAY,
    BINS,
    BREATH,
    DEPTHS,
    DIFFER,
    DUE,
    EVEN,
    FRAMES,
    LOOSE,
    LOST,
    MISFIT,
    OFFSET,
    ORDER,
    PLAIN,
    POWER,
    RATES,
    RECORD,
    ROWS,
    SHARE,
    SIZE,
    SPREAD,
    TEMPLATE,
    TIME,
    TROUBLE,
    USUAL,
    USUALLY,
    WEIGHTS,
    Floats,
    correct,
    go_on,
    learn,
    report,
    template_at,
)
from systems.sensing.breath_search import begin, search

_AVERAGED = 6  # frames in an entry of the record in which the rate is searched
_SHORTEST = 480  # frames before the first search
_EVERY = 12  # frames between two searches
_TWICE = 0.5  # residual against amplitude at twice a rate that is half a breath's
_TROUBLED, _TOO_MUCH = 12.0, 0.3  # s, share of them in alarm: it is learnt anew
_DIES = 0.4  # s in which the difference of two that were found does
_STRAYED = 2.5  # times the noise
_LEAST = 0.01
_MORE = 1.5  # square of what the filter smooths away
_EVENED, _EVENLY = 0.5, 0.2  # how soon the even phase follows, and draws the template
_LOOSE = 0.15  # s by which the loose breath comes after the filter's
_USUALLY = 3.0  # spreads of its misfit that are usual

read_frame = reader(TrackedShaft)


class OrganMotion(NamedTuple):
    """A point of an organ and how well it is known."""

    p: Annotated[Vector, Field("m", "p_WE now", (0.0, 0.0, -0.12))]
    v: Annotated[Vector, Field("m/s", "v_WE", (0.0, 0.0, 0.0))]
    sigma: Annotated[float, Field("m", "rms of what the frames do not fit", 1e-4)]
    sure: Annotated[
        float, Field("1", "1 while the frames fit a known breath, else 0", 1.0)
    ]
    alarm: Annotated[
        float, Field("1", "1 after a known breath was lost, until it is found", 0.0)
    ]


@dataclass
class OrganEstimatorParams:
    """How the breath is learnt."""

    breaths: float = parameter(16.0, "that the template remembers", above=0, most=100)
    offset_walk: float = parameter(
        1e-4, "of the offset in a second", "m", above=0, most=0.01
    )
    miss: float = parameter(
        6e-4, "of a frame along an axis by noise and template", "m", above=0, most=0.01
    )
    noise: float = parameter(
        2e-4, "of a frame that is expected, in space", "m", above=0, most=0.01
    )
    alarm: float = parameter(
        7e-4, "misfit over some frames that means alarm", "m", above=0, most=0.02
    )
    fits: float = parameter(
        4e-4,
        "rms misfit at which a lost breath is found again",
        "m",
        above=0,
        most=0.02,
    )
    start: float = parameter(
        2.0, "in which a template that was found comes in", "s", above=0, most=60
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0, most=0.1)


@compiled
def track(c: Any, s: Floats, z: Floats, dt: float) -> None:
    """The plain track: an alpha-beta filter of the frames, quick where they stray."""
    p, v = s[PLAIN : PLAIN + 3], s[PLAIN + 3 : PLAIN + 6]
    p += dt * v
    e = z - p
    quick = (e * e).sum() > (_STRAYED * c.noise) ** 2
    p += (0.7 if quick else 0.3) * e
    v += (0.4 if quick else 0.06) / dt * e


@compiled
def is_lost(c: Any, z: Floats, place: Floats, dt: float) -> bool:
    """Whether a breath that is slow to follow misses what is seen.

    The filter follows all that a breath may be. What stops or bursts leaves the loose
    breath behind, by more than breaths that differ usually do at this phase.
    """
    s, x, y = z[:TEMPLATE], z[BREATH:LOOSE], z[LOOSE:SPREAD]
    T = z[TEMPLATE:WEIGHTS].reshape((BINS, 3))
    usually = z[USUALLY:ROWS]
    y[0] += dt * y[1]
    e = place - y[3:] - y[2] * template_at(T, y[0])[0]
    y += min(dt / _LOOSE, 1.0) * (x - y)
    s[LOST:AWAY] += 0.7 * (e - s[LOST:AWAY])
    square = (s[LOST:AWAY] ** 2).sum()
    k = int((x[0] - floor(x[0])) * BINS)
    if square > (0.7 * c.alarm) ** 2 + _USUALLY**2 * usually[k]:
        return True
    share = s[USUAL] * dt / c.breaths * BINS
    for i in range(-2, 3):
        j = (k + i) % BINS
        usually[j] += 0.4 * share * (square - usually[j])
    return False


@compiled
def take(c: Any, z: Floats, time: float, place: Floats) -> None:
    """Takes a frame into the state z, in place."""
    s, x = z[:TEMPLATE], z[BREATH:LOOSE]
    P = z[SPREAD:TEMPLATE].reshape((ORDER, ORDER))
    T, weights = z[TEMPLATE:WEIGHTS].reshape((BINS, 3)), z[WEIGHTS:USUALLY]
    rows = z[ROWS:].reshape((RECORD, 4))
    first = s[FRAMES] == 0.0
    dt = time - s[TIME]
    if first:
        s[PLAIN : PLAIN + 3] = place
        s[OFFSET:LOOSE] = place
    else:
        track(c, s, place, dt)
    row = rows[int(s[FRAMES]) % RECORD]
    row[0] = time
    row[1:] = place
    s[FRAMES] += 1.0
    s[TIME] = time
    if first:
        return
    s[AWAY:PLAIN] *= max(1.0 - dt / _DIES, 0.0)
    if s[SHARE] == 0.0:  # no template: the mean so far
        x[3:] += (place - x[3:]) / min(s[FRAMES], RECORD)
        return
    s[SHARE] = min(1.0, s[SHARE] + dt / c.start)
    s[TROUBLE] += min(dt / _TROUBLED, 1.0) * (s[ALARM] - s[TROUBLE])
    if s[ALARM] == 1.0:
        return
    go_on(c, s, x, P, dt)
    e, plain = correct(x, P, T, place, c.miss)
    s[POWER] += dt * ((e * e).sum() - s[POWER])
    s[MISFIT:LOST] += 0.5 * (plain - s[MISFIT:LOST])
    lost = is_lost(c, z, place, dt) or (s[MISFIT:LOST] ** 2).sum() > c.alarm**2
    if lost:
        s[AWAY:PLAIN] = 0.0
        if s[SHARE] < 1.0:  # it was none
            s[AWAY:PLAIN] = report(z, time)[:3] - x[3:]
            s[SHARE] = 0.0
        else:
            s[ALARM] = 1.0
        return
    share = s[USUAL] * dt / c.breaths
    value, slope = template_at(T, x[0])
    # Any phase that rises fits as well: the one that is the most even is taken.
    s[EVEN] += dt * s[USUAL] * (1.0 + _EVENED * (x[0] - s[EVEN]))
    seen = place - x[3:] - (x[2] - 1.0) * value + _EVENLY * (x[0] - s[EVEN]) * slope
    learn(T, weights, x[0], seen, share * BINS)
    rate = x[1] / s[USUAL] - 1.0
    s[RATES] += share * (_MORE * rate**2 - s[RATES])
    s[DEPTHS] += share * (_MORE * (x[2] - 1.0) ** 2 - s[DEPTHS])
    for k in (RATES, DEPTHS):
        s[k] = min(max(s[k], _LEAST**2), DIFFER**2)
    s[USUAL] += share * (x[1] - s[USUAL])


@compiled
def follow(packed: Floats, old: Floats, frame: Floats) -> Floats:
    """The next state, with a delivered frame if it is a new one."""
    z = old.copy()
    c, seen = packed[0], read_frame(frame)
    new = seen.valid > 0.5 and seen.time > z[TIME] + 1e-9
    place = np.array(seen.tip)
    if not (new and np.isfinite(place).all()):
        return z
    take(c, z, seen.time, place)
    z[DUE] -= 1.0
    if z[ALARM] == 1.0 and z[DUE] <= 0.0:
        search(c, z)
        z[DUE] = _EVERY
    return z


def constants(params: OrganEstimatorParams) -> Floats:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


class OrganEstimator(Block):
    """Predicts a point of an organ that moves with the breath.

    Port ``measurement`` accepts the tracker's frames of it, a `TrackedShaft`.

    Port ``motion`` emits the `OrganMotion` now.

    Port ``ahead`` emits it one period later.
    """

    def __init__(self, params: OrganEstimatorParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._p = params or OrganEstimatorParams()
        self._constants = constants(self._p)
        self._frame = self.signal_in("measurement", TrackedShaft)
        initial = np.zeros(SIZE)
        initial[TIME] = -1.0
        initial[OFFSET:LOOSE] = example(OrganMotion).p
        self.DeclareDiscreteState(initial)
        reads = {self._frame.ticket(), self.xd_ticket()}
        self._next = self.cached("next", self._calc_next, reads)
        after = {self._next.ticket(), self.time_ticket()}
        for name, lead in (("motion", 0.0), ("ahead", self._p.period)):

            def calc(context: Any, lead: float = lead) -> Floats:
                z = self._next.Eval(context)
                return report(z, context.get_time() + lead)

            self.signal_out(name, OrganMotion, calc, after)
        self.update_every(self._p.period, self._next.Eval)

    def _calc_next(self, context: Any) -> Floats:
        old = context.get_discrete_state_vector().value()
        z = follow(self._constants, old, self._frame.Eval(context))
        looks = z[FRAMES] >= _SHORTEST and z[FRAMES] % 60.0 == 0.0
        if looks and z[FRAMES] > old[FRAMES]:
            self.look(z)
        return z

    def look(self, z: Floats) -> None:
        """Looks for the breath in the record, or for an organ that is still.

        Nothing is looked for where one is known and seldom lost.
        """
        count = int(min(z[FRAMES], RECORD))
        rows = z[ROWS:].reshape(RECORD, 4)
        rows = np.roll(rows, -int(z[FRAMES]) % RECORD, axis=0)[-count:]
        lost = z[TROUBLE] > _TOO_MUCH
        if z[SHARE] > 0.0 and not lost:
            return
        entries = rows[count % _AVERAGED :, 1:].reshape(-1, _AVERAGED, 3).mean(axis=1)
        period = (rows[-1, 0] - rows[0, 0]) / (count - 1) * _AVERAGED
        fit = find_breathing(entries, period, 3)
        while fit is not None:  # two breaths that differ are no long one
            twice = fit_breathing(entries, period, 3, 2.0 * fit.rate)
            if twice.residual > _TWICE * twice.amplitude:
                break
            fit = twice
        found = z.copy()
        if fit is not None and fit.amplitude > max(self._p.noise, 2.0 * fit.residual):
            # Two breaths are soon fitted: they have to fit better than three.
            most = self._p.alarm * (1.0 if count == RECORD else 0.5)
            if begin(self._constants[0], found, fit.rate) < most:
                found[AWAY:PLAIN] += report(z, z[TIME])[:3] - report(found, z[TIME])[:3]
                z[:] = found
        elif not lost and count == RECORD and entries.std(axis=0).max() < self._p.noise:
            begin(self._constants[0], z, 0.25)
