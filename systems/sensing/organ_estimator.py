"""Organ estimator: where a point of an organ is now, learnt from breath to breath.

What the tracker delivers is 20 to 50 ms old, in which an organ moves by half a
millimetre. Breathing repeats itself: the estimate is a template of the breath, the mean
over the last breaths in bins of their phase, read at the phase of now,

    p(t) = b + T(phi(t)),   phi' = omega,

b being a slow offset. The phase is corrected with each frame (a phase-locked loop on
the slope of T), so a breath may be longer than the one before. The first template is
made from a record of some seconds, with the rate that `breathing_rate` finds in it.

A cough or a breath that stops shows as frames that do not fit: *alarm*. The estimate
is then the plain track of the frames, nothing is learnt, and the record is searched for
the phase at which the template fits again.
"""

from dataclasses import dataclass
from math import floor, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, example, reader
from systems.common.signals import TrackedShaft
from systems.passive_wrist.breathing_rate import find_breathing

BINS = 100
"""Of the template."""
RECORD = 720
"""Frames that are remembered."""
_AVERAGED = 6  # frames in an entry of the record in which the rate is searched
_SHORTEST = 480  # frames before the first search
_SHARE = 1.5  # s of the record in which a lost phase is searched
_EVERY = 12  # frames between two searches
_STRAYED = 2.5  # times the noise

Floats = np.ndarray
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
    bandwidth: float = parameter(
        0.2, "of the phase-locked loop", "rad/s", above=0, most=10
    )
    offset_time: float = parameter(
        5.0, "time constant of the offset", "s", above=0, most=1e3
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


SCALARS = ("phi", "omega", "time", "frames", "share", "misfit", "power", "alarm", "due")
"""Phase in breaths at the last frame; rate in 1/s; time of the last frame in s; frames
so far; share of the template that is in use; smoothed misfit in m; smoothed square of
it; 1 in alarm; frames until the next search."""
(PHI, OMEGA, TIME, FRAMES, SHARE, MISFIT, POWER, ALARM, DUE) = range(len(SCALARS))
PLAIN = len(SCALARS)  # p, v of the plain track (6)
OFFSET = PLAIN + 6  # b (3)
TEMPLATE = OFFSET + 3  # (BINS, 3)
WEIGHTS = TEMPLATE + 3 * BINS
ROWS = WEIGHTS + BINS  # (RECORD, 4): time and place of the frames, a ring
SIZE = ROWS + 4 * RECORD


@compiled
def template_at(T: Floats, phi: float) -> tuple[Floats, Floats]:
    """The template (bins, 3) at a phase in breaths, and its slope per breath.

    Cubic between the bins (Catmull and Rom), periodic.
    """
    n = len(T)
    place = (phi - floor(phi)) * n
    k = int(place)
    t = place - k
    a, b, c, d = T[(k - 1) % n], T[k % n], T[(k + 1) % n], T[(k + 2) % n]
    value = b + 0.5 * t * (
        c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a))
    )
    slope = 0.5 * (
        c
        - a
        + 2.0 * t * (2.0 * a - 5.0 * b + 4.0 * c - d)
        + 3.0 * t * t * (3.0 * (b - c) + d - a)
    )
    return value, slope * n


@compiled
def learn(T: Floats, weights: Floats, phi: float, z: Floats, least: float) -> None:
    """Moves the bins about a phase towards what was seen there, in place."""
    n = len(T)
    place = (phi - floor(phi)) * n
    k = int(place)
    t = place - k
    e = z - template_at(T, phi)[0]
    for i, w in ((k % n, 1.0 - t), ((k + 1) % n, t)):
        weights[i] += w
        T[i] += w * max(least, 1.0 / max(weights[i], 1.0)) * e


@compiled
def correct(c: Any, s: Floats, T: Floats, e: Floats, slope: Floats, dt: float) -> None:
    """The phase-locked loop: phase and rate from a misfit e."""
    steep = (slope * slope).sum() + c.flat**2
    late = (slope * e).sum() / steep
    s[PHI] += 1.4 * c.bandwidth * dt * late
    s[OMEGA] += c.bandwidth**2 * dt * late
    s[OMEGA] = min(max(s[OMEGA], 0.08), 0.6)


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
def take(c: Any, z: Floats, time: float, place: Floats) -> None:
    """Takes a frame into the state z, in place."""
    s = z[:TEMPLATE]
    T, weights = z[TEMPLATE:WEIGHTS].reshape((BINS, 3)), z[WEIGHTS:ROWS]
    rows = z[ROWS:].reshape((RECORD, 4))
    first = s[FRAMES] == 0.0
    dt = time - s[TIME]
    if first:
        s[PLAIN : PLAIN + 3] = place
        s[OFFSET:TEMPLATE] = place
    else:
        track(c, s, place, dt)
    row = rows[int(s[FRAMES]) % RECORD]
    row[0] = time
    row[1:] = place
    s[FRAMES] += 1.0
    s[TIME] = time
    if first:
        return
    if s[SHARE] == 0.0:  # no template: the mean so far
        b = s[OFFSET:TEMPLATE]
        b += (place - b) / min(s[FRAMES], RECORD)
        return
    s[SHARE] = min(1.0, s[SHARE] + dt / c.start)
    s[PHI] += s[OMEGA] * dt
    value, slope = template_at(T, s[PHI])
    b = s[OFFSET:TEMPLATE]
    e = place - b - value
    square = (e * e).sum()
    s[MISFIT] += 0.5 * (sqrt(square) - s[MISFIT])
    s[POWER] += dt * (square - s[POWER])
    if s[MISFIT] > c.alarm:
        s[ALARM] = 1.0
    if s[ALARM] == 0.0:
        correct(c, s, T, e, slope, dt)
        b += dt / c.offset_time * e
        learn(T, weights, s[PHI], place - b, s[OMEGA] * BINS * dt / c.breaths)


@compiled
def search(c: Any, z: Floats) -> None:
    """Looks for the phase at which the template fits the last frames, in place."""
    s, T = z[:TEMPLATE], z[TEMPLATE:WEIGHTS].reshape((BINS, 3))
    rows = z[ROWS:].reshape((RECORD, 4))
    count = 0
    while count < min(s[FRAMES], RECORD):
        row = rows[(int(s[FRAMES]) - 1 - count) % RECORD]
        if s[TIME] - row[0] > _SHARE:
            break
        count += 1
    best, at = 1e9, 0.0
    offset = np.zeros(3)
    for k in range(BINS):
        phi = k / BINS
        total, squares = np.zeros(3), 0.0
        for i in range(count):
            row = rows[(int(s[FRAMES]) - 1 - i) % RECORD]
            e = row[1:] - template_at(T, phi - s[OMEGA] * (s[TIME] - row[0]))[0]
            total += e
            squares += (e * e).sum()
        mean = total / max(count, 1)
        left = squares / max(count, 1) - (mean * mean).sum()
        if left < best:
            best, at = left, phi
            offset[:] = mean
    moved = offset - s[OFFSET:TEMPLATE]
    fits = best < c.fits**2 and (moved * moved).sum() < (10.0 * c.fits) ** 2
    if fits:
        s[PHI], s[ALARM], s[MISFIT] = at, 0.0, 0.0
        s[POWER] = best
        s[OFFSET:TEMPLATE] = offset


@compiled
def begin(c: Any, z: Floats, rate: float) -> None:
    """Makes the first template from the record, in place; rate in 1/s."""
    s = z[:TEMPLATE]
    T, weights = z[TEMPLATE:WEIGHTS].reshape((BINS, 3)), z[WEIGHTS:ROWS]
    rows = z[ROWS:].reshape((RECORD, 4))
    count = int(min(s[FRAMES], RECORD))
    first = int(s[FRAMES]) - count
    s[OFFSET:TEMPLATE] = 0.0
    for i in range(count):
        s[OFFSET:TEMPLATE] += rows[(first + i) % RECORD, 1:] / count
    T[:] = 0.0
    weights[:] = 0.0
    s[OMEGA] = rate
    for turn in range(4):
        s[PHI] = (
            0.0
            if turn == 0
            else s[PHI] - s[OMEGA] * (s[TIME] - rows[first % RECORD, 0])
        )
        before = rows[first % RECORD, 0]
        for i in range(count):
            row = rows[(first + i) % RECORD]
            dt = row[0] - before
            before = row[0]
            s[PHI] += s[OMEGA] * dt
            place = row[1:] - s[OFFSET:TEMPLATE]
            if turn > 0:
                value, slope = template_at(T, s[PHI])
                correct(c, s, T, place - value, slope, dt)
            learn(T, weights, s[PHI], place, 0.0)
        if turn < 3:
            weights *= 0.3
    s[SHARE] = 1e-6
    s[MISFIT], s[POWER], s[ALARM] = c.noise, c.noise**2, 0.0


@compiled
def report(z: Floats, time: float) -> Floats:
    """The elements of `OrganMotion` at a time in s."""
    s = z[:TEMPLATE]
    T = z[TEMPLATE:WEIGHTS].reshape((BINS, 3))
    out = np.zeros(9)
    ahead = max(0.0, time - s[TIME])
    known = s[SHARE] > 0.0
    if s[ALARM] == 1.0:
        out[0:3] = s[PLAIN : PLAIN + 3] + ahead * s[PLAIN + 3 : PLAIN + 6]
        out[3:6] = s[PLAIN + 3 : PLAIN + 6]
    elif known:
        value, slope = template_at(T, s[PHI] + s[OMEGA] * ahead)
        share = s[SHARE] * s[SHARE] * (3.0 - 2.0 * s[SHARE])
        out[0:3] = s[OFFSET:TEMPLATE] + share * value
        out[3:6] = share * s[OMEGA] * slope
    else:
        out[0:3] = s[OFFSET:TEMPLATE]
    out[6] = sqrt(s[POWER]) if known else 1.0
    out[7] = 1.0 if s[SHARE] == 1.0 and s[ALARM] == 0.0 else 0.0
    out[8] = s[ALARM]
    return out


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
    # Below this slope in m a breath the phase is not heard.
    return packed(params, flat=20.0 * params.noise)


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
        initial[OFFSET:TEMPLATE] = example(OrganMotion).p
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
        if looks and z[SHARE] == 0.0 and z[FRAMES] > old[FRAMES]:
            self._look(z)
        return z

    def _look(self, z: Floats) -> None:
        """Looks for the breath in the record, or for an organ that is still."""
        count = int(min(z[FRAMES], RECORD))
        rows = z[ROWS:].reshape(RECORD, 4)
        rows = np.roll(rows, -int(z[FRAMES]) % RECORD, axis=0)[-count:]
        entries = rows[count % _AVERAGED :, 1:].reshape(-1, _AVERAGED, 3).mean(axis=1)
        span = rows[-1, 0] - rows[0, 0]
        fit = find_breathing(entries, span / (count - 1) * _AVERAGED, 3)
        if fit is not None and fit.amplitude > max(self._p.noise, 3.0 * fit.residual):
            begin(self._constants[0], z, fit.rate)
        elif count == RECORD and entries.std(axis=0).max() < self._p.noise:
            begin(self._constants[0], z, 0.25)
