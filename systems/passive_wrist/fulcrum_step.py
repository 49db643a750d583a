"""One step of the fulcrum tracker, compiled: policy round the filter's arithmetic.

What it decides, and why, stands in `fulcrum_tracker`. All it remembers is one array z:
x (n), P (n n), the record (120 entries), the sums for its next entry, the scalars
named below, each harmonic's rms in m when the breathing was found, and the finer
harmonics that the bank of waves knows.
"""

from math import cos, exp, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    along,
    dot,
    over,
    plus,
    scaled,
    sub,
    xyz,
)
from systems.common.parameter import check
from systems.common.signal import finiteness, reader, writer
from systems.common.signals import Fulcrum, ShaftMotion, Wrench
from systems.passive_wrist import steady as steadying
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_kernels import (
    LN_K,
    LN_OMEGA,
    RECORD_PERIOD,
    WIDTH,
    Sample,
    covariance,
    entry_of,
    innovate,
    predict,
    spread,
    update,
    write_entry,
)
from systems.passive_wrist.steady import leak

Floats = np.ndarray

RECORD = 120
"""Entries of the record."""
SCALARS = (
    *("phase", "steps", "unlikely", "guard", "nis", "recorded", "agreed", "found"),
    *("jumps", "refused", "walk", "summed", "time", "due", "led", "wave"),
)
"""Phase; steps so far; unlikely samples in a row; s of guard left after a jump; nis,
smoothed normalised innovation squared / 4 (1 = as expected); entries recorded; looks in
a row that agreed on a rate; the rate found, in Hz; jumps followed; estimates refused;
walk of the mean once the wall is understood, in m/sqrt(s); samples summed; time of the
last update in s; 1 if an entry was just added; s for which the depth is still the
bank's; the rate that the bank last took, in Hz."""
(PHASE, STEPS, UNLIKELY, GUARD, NIS, RECORDED, AGREED, FOUND) = range(8)
(JUMPS, REFUSED, WALK, SUMMED, TIME, DUE, LED, WAVE) = range(8, len(SCALARS))
BEFORE, FOLLOWING, BREATHING = 0.0, 1.0, 2.0
"""Phases."""
LEAST_BREATHING = 2e-4
"""Rms of the first harmonic from which there is breathing to speak of [m]."""
LEAST_RMS = 3e-4
"""Rms that a harmonic is taken to have at the least, for its walk [m]."""
_JUMP_NIS = 30.0  # normalised innovation squared of a jump
_GUARD_TIME = 0.1  # s after a jump in which only the mean is updated
_GUARD_WALK = 0.05  # m/sqrt(s): the rest of a jump that takes more than two samples
_LARGEST_JUMP = 0.02  # [m]
_UNDERSTOOD = 4.0  # times the force above which the stiffness is learnt
_DEPTH_UNKNOWN = 6e-3  # [m] sigma along the shaft
HARMONICS = 6
"""Of the wave along the shaft, once it is found."""
LED_FOR = 12.0
"""s for which the depth that a record told is kept: as long as the record."""

read_shaft, read_wrench = reader(ShaftMotion), reader(Wrench)
write_fulcrum = writer(Fulcrum)
finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)


def constants(params: FulcrumParams) -> Floats:
    """The parameters as the compiled functions take them.

    With `n`, `every`: samples in an entry of the record, and where in z its parts
    begin.
    """
    check(params, "fulcrum_estimator")
    n = 5 + 6 * params.harmonics
    finer = 6 * (HARMONICS - params.harmonics)
    steady = steadying.SIZE if params.steady else 0
    lengths = [n, n * n, RECORD * WIDTH, WIDTH, len(SCALARS)]
    lengths += [params.harmonics, finer, steady]
    names = ("P", "record", "sums", "scalars", "rms", "finer", "steady_at", "end")
    places = dict(zip(names, np.cumsum(lengths).tolist(), strict=True))
    every = max(1, round(RECORD_PERIOD / params.period))
    return packed(params, n=n, every=float(every), **places)


class Memory(NamedTuple):
    """The parts of z.

    Attributes:
        x: State, shape (n,).
        P: Its covariance, shape (n, n).
        record: Entries, the oldest first, shape (120, 13).
        sums: For its next entry, shape (13,).
        scalars: See `SCALARS`.
        rms: Of each harmonic, in m.
        finer: a, b (3 each) of the bank's harmonics above the filter's, when it
            last spoke.
        steady: Of `steady`, if the estimate is kept so.
    """

    x: Floats
    P: Floats
    record: Floats
    sums: Floats
    scalars: Floats
    rms: Floats
    finer: Floats
    steady: Floats


@compiled
def memory(packed: Floats, z: Floats) -> Memory:
    """The parts of z; nothing is copied."""
    c = packed[0]
    n = c.n
    return Memory(
        z[:n],
        z[n : c.record].reshape((n, n)),
        z[c.record : c.sums].reshape((RECORD, WIDTH)),
        z[c.sums : c.scalars],
        z[c.scalars : c.rms],
        z[c.rms : c.finer],
        z[c.finer : c.steady_at],
        z[c.steady_at :],
    )


@compiled
def to_first_force(c: Any, x: Floats, P: Floats, a: Sample) -> None:
    """Puts the mean on the line that a sample's force implies; its depth is kept."""
    K = exp(x[LN_K])
    depth = dot(a.u, sub(xyz(x, 0), a.p))
    offset = over(across(a.f, a.u), K)
    side = (c.force_noise / K) ** 2 + c.pose_noise**2
    sigma2 = P[LN_K, LN_K]
    x[0:3] = plus(along(a.p, depth, a.u), offset)
    P[0:3, :] = 0.0
    P[:, 0:3] = 0.0
    for i in range(3):
        for j in range(3):
            # An unknown stiffness leaves the offset along the force unknown with it.
            P[i, j] = (c.guess_sigma**2 - side) * a.u[i] * a.u[j]
            P[i, j] += sigma2 * offset[i] * offset[j]
        P[i, i] += side
        P[i, LN_K] = P[LN_K, i] = -sigma2 * offset[i]


@compiled
def follow_jump(c: Any, x: Floats, P: Floats, a: Sample, size: float) -> None:
    """The wall has jumped by about `size` m: fits the mean alone, iterated."""
    for i in range(3):
        P[i, i] += size**2
    prior = x[0:3].copy()
    for _ in range(4):
        seen = innovate(c, x, P, a)
        # The innovation seen from the prior, linearised at the iterate.
        for j in range(4):
            for i in range(3):
                seen.y[j] += seen.H[j, i] * (x[i] - prior[i])
        for i in range(3):
            x[i] = prior[i]
            for j in range(4):
                x[i] += seen.gain[i, j] * seen.y[j]
    x[0:3] = prior
    update(x, P, seen, a.u, 1.0, 3)


@compiled
def sample_at(c: Any, shaft: ShaftMotion, wrench: Wrench) -> Sample:
    """A reading as a sample; its angle counts while the tip moves across the shaft."""
    tip = along(shaft.v, c.length, shaft.du)
    lengthwise = dot(tip, shaft.u)
    speed = sqrt(max(dot(tip, tip) - lengthwise**2, 0.0))
    turning = min(max(speed / c.depth_speed - 1.0, 0.0), 1.0)
    p, u, v, du = shaft
    return Sample(p, u, v, du, wrench.f, wrench.m, c.damping, 1.0, turning)


@compiled
def uncertainty(packed: Floats, z: Floats) -> Floats:
    """The elements of the `Covariance` at the last update."""
    m = memory(packed, z)
    bias = 0.5 * packed[0].force_bias / exp(m.x[LN_K])
    return covariance(m.P, bias).reshape(-1)


@compiled
def report(packed: Floats, z: Floats, time: float, shaft_now: Floats) -> Floats:
    """The elements of the `Fulcrum` at a time.

    Args:
        packed: Of `constants`.
        z: State.
        time: In s.
        shaft_now: Elements of the `ShaftMotion`.
    """
    c = packed[0]
    shaft = read_shaft(shaft_now)
    m = memory(packed, z)
    x, P, scalars = m.x, m.P, m.scalars
    omega, K = exp(x[LN_OMEGA]), exp(x[LN_K])
    ahead = max(0.0, time - scalars[TIME]) + c.latency
    p, v = xyz(x, 0), (0.0, 0.0, 0.0)
    for k in range(len(m.rms)):
        w = (k + 1) * omega
        co, si = cos(w * ahead), sin(w * ahead)
        a, b = xyz(x, 3 + 6 * k), xyz(x, 6 + 6 * k)
        p = plus(p, along(scaled(co, a), -si, b))
        v = along(v, -w, along(scaled(si, a), co, b))
    if scalars[LED] > 0.0:
        since = LED_FOR - scalars[LED] + ahead
        for k in range(len(m.finer) // 6):
            w = (len(m.rms) + k + 1) * omega
            co, si = cos(w * since), sin(w * since)
            a, b = xyz(m.finer, 6 * k), xyz(m.finer, 6 * k + 3)
            p = along(p, dot(shaft.u, along(scaled(co, a), -si, b)), shaft.u)
            v = along(v, -w * dot(shaft.u, along(scaled(si, a), co, b)), shaft.u)
    sigma_across, sigma_along = spread(P, shaft.u, 0.5 * c.force_bias / K)
    seen = scalars[PHASE] == BREATHING and m.rms[0] >= LEAST_BREATHING
    fulcrum = Fulcrum(
        p,
        v,
        sigma_across,
        sigma_along,
        K,
        sqrt(P[LN_K, LN_K]),
        omega / (2.0 * pi) if seen else 0.0,
        scalars[PHASE],
        scalars[JUMPS],
        scalars[REFUSED],
    )
    return write_fulcrum(fulcrum)


@compiled
def advance(
    packed: Floats, old: Floats, time: float, shaft_now: Floats, wrench_now: Floats
) -> Floats:
    """The tracker's next state.

    Args:
        packed: Of `constants`.
        old: State z.
        time: In s.
        shaft_now: Elements of the `ShaftMotion`.
        wrench_now: Elements of the `Wrench`.
    """
    c = packed[0]
    n = c.n
    z = old.copy()
    x, P, record, sums, aux, rms, _, steady = memory(packed, z)
    shaft, wrench = read_shaft(shaft_now), read_wrench(wrench_now)
    parts = c.amplitude_walk * np.maximum(rms, LEAST_RMS)
    aux[TIME], aux[DUE] = time, 0.0
    aux[LED] = max(aux[LED] - c.period, 0.0)
    known = aux[PHASE] == BREATHING
    walk = aux[WALK] * min(max(aux[NIS], 1.0), 10.0) if known else c.wall_walk
    if not (wrench.valid > 0.5 and finite_wrench(wrench) and finite_shaft(shaft)):
        if aux[PHASE] != BEFORE:
            predict(x, P, c.period, walk, parts, known)
            aux[RECORDED] = aux[SUMMED] = 0.0  # a record must have no gaps
            sums[:] = 0.0
        return z
    a = sample_at(c, shaft, wrench)
    force = sqrt(max(dot(a.f, a.f) - dot(a.f, a.u) ** 2, 0.0))
    aux[STEPS] += 1.0
    if aux[PHASE] == BEFORE:
        to_first_force(c, x, P, a)
        aux[PHASE] = FOLLOWING
        return z
    guard = aux[GUARD] > 0.0
    if guard:
        aux[GUARD] -= c.period
        walk = _GUARD_WALK
    predict(x, P, c.period, walk, parts, known)
    if aux[LED] > 0.0:  # the walk is for what the filter's harmonics miss
        spared = max(walk**2 - c.still_walk**2, 0.0) * c.period
        for i in range(3):
            for j in range(3):
                P[i, j] -= spared * a.u[i] * a.u[j]
    turning = a.turning
    if not known:
        # A wall that breathes unseen under a turning shaft looks like a depth error:
        # angles are heard only while the depth is hardly known at all.
        sigma = spread(P, a.u, 0.0)[1]
        turning *= min(max(sigma / _DEPTH_UNKNOWN - 1.0, 0.0), 1.0)
    if c.steady and known:
        turning = 0.0
    seen = innovate(c, x, P, a)
    if seen.nis < 0.0:
        raise ValueError("fulcrum estimator: a covariance is not positive definite")
    if seen.nis > _JUMP_NIS and not guard:
        aux[UNLIKELY] += 1.0
        if aux[UNLIKELY] < 2.0:
            return z  # coasted over: one unlikely sample
        size = 1.5 * sqrt(seen.y[0] ** 2 + seen.y[1] ** 2) / exp(x[LN_K])
        follow_jump(c, x, P, a, min(_LARGEST_JUMP, size))
        aux[UNLIKELY], aux[GUARD], aux[RECORDED] = 0.0, _GUARD_TIME, 0.0
        aux[JUMPS] += 1.0
        aux[LED] = 0.0
    else:
        aux[UNLIKELY] = 0.0
        aux[NIS] += 0.02 * (min(seen.nis, 60.0) / 4.0 - aux[NIS])
        # Once the wall is understood, force is mostly what the prediction missed of
        # its motion, and says less of its stiffness.
        least = c.learn_above * (_UNDERSTOOD if known else 1.0)
        held = 3 if guard else (n if force > least else n - 1)
        # One sample at a time the filter tells a wave from a depth worse than the
        # bank does from the whole record.
        led = aux[LED] > 0.0
        told = max(seen.seen, turning)
        update(x, P, seen, a.u, 0.0 if led else told, held)
        if c.steady and known:
            told = 1.0 if led else told
            leak(steady, x, P, a.u, xyz(c.guess, 0), told, c.period)
    sums += write_entry(entry_of(x, a, turning, seen.w))
    aux[SUMMED] += 1.0
    if aux[SUMMED] >= c.every:
        record[:-1] = record[1:].copy()
        record[-1] = sums / aux[SUMMED]
        sums[:], aux[SUMMED] = 0.0, 0.0
        aux[RECORDED] = min(aux[RECORDED] + 1.0, RECORD)
        aux[DUE] = 1.0
    fulcrum = xyz(x, 0)
    for k in range(3, n - 2, 6):
        fulcrum = plus(fulcrum, xyz(x, k))
    away = sub(fulcrum, c.guess)
    if c.steady and known:
        away = across(away, a.u)
    if dot(away, away) > c.neighbourhood**2:  # refused: starts anew
        aux[REFUSED] += 1.0
        aux[PHASE] = FOLLOWING
        aux[GUARD] = aux[RECORDED] = aux[AGREED] = aux[LED] = 0.0
        x[:LN_OMEGA] = 0.0
        x[0:3] = c.guess
        own = P[LN_K, LN_K]
        P[:] = 0.0
        P[LN_K, LN_K] = own
        to_first_force(c, x, P, a)
    return z
