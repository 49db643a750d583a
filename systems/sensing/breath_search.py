"""Where the breath is not known: the first template, and a breath that was lost."""

from math import sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled
from systems.sensing.breath_filter import (
    ALARM,
    AWAY,
    BINS,
    BREATH,
    DEPTHS,
    DIFFER,
    EVEN,
    FRAMES,
    LOOSE,
    MISFIT,
    ORDER,
    PLAIN,
    POWER,
    RATES,
    RECORD,
    ROWS,
    SHARE,
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
    smoothed,
    template_at,
    unknown,
)

_SHARE = 1.5  # s of the record in which a lost phase is searched
_TURNS = 6  # through the first record
_EACH = 4  # of which frames the search takes one


@compiled
def search(c: Any, z: Floats) -> None:
    """Looks for the breath that fits the last frames, in place.

    Phase and rate are tried, depth and offset follow.
    """
    s, x, T = z[:TEMPLATE], z[BREATH:LOOSE], z[TEMPLATE:WEIGHTS].reshape((BINS, 3))
    rows = z[ROWS:].reshape((RECORD, 4))
    count = 0
    while _EACH * count < min(s[FRAMES], RECORD):
        row = rows[(int(s[FRAMES]) - 1 - _EACH * count) % RECORD]
        if s[TIME] - row[0] > _SHARE:
            break
        count += 1
    best, found = 1e9, x.copy()
    stiff = (c.fits / (3.0 * DIFFER)) ** 2
    for k in range(3 * BINS):
        phi = k / (3 * BINS)
        omega = s[USUAL] * (1.0 + DIFFER * (k % 3 - 1))
        here, there, both, one, other = np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0
        for i in range(count):
            row = rows[(int(s[FRAMES]) - 1 - _EACH * i) % RECORD]
            value = template_at(T, phi - omega * (s[TIME] - row[0]))[0]
            seen = row[1:] - x[3:]
            here += value / count
            there += seen / count
            one += (value * value).sum() / count
            other += (seen * seen).sum() / count
            both += (value * seen).sum() / count
        one -= (here * here).sum()
        other -= (there * there).sum()
        both -= (here * there).sum()
        d = (both + stiff) / (one + stiff)
        left = other - 2.0 * d * both + d * d * one + stiff * (d - 1.0) ** 2
        if left < best:
            best = left
            found[0], found[1], found[2] = phi, omega, d
            found[3:] = x[3:] + there - d * here
    moved = found[3:] - x[3:]
    if best < c.fits**2 and (moved * moved).sum() < (10.0 * c.fits) ** 2:
        before = report(z, s[TIME])[:3]
        x[:] = found
        z[LOOSE:SPREAD] = x
        s[EVEN] = x[0]
        unknown(c, x, z[SPREAD:TEMPLATE].reshape((ORDER, ORDER)), s[USUAL])
        s[ALARM], s[POWER] = 0.0, best
        s[MISFIT:AWAY] = 0.0
        s[AWAY:PLAIN] = before - report(z, s[TIME])[:3]


@compiled
def begin(c: Any, z: Floats, rate: float) -> float:
    """Makes the first template from the record, in place; rate in 1/s.

    Returns:
        The rms misfit in m.
    """
    s, x = z[:TEMPLATE], z[BREATH:LOOSE]
    P = z[SPREAD:TEMPLATE].reshape((ORDER, ORDER))
    T, weights = z[TEMPLATE:WEIGHTS].reshape((BINS, 3)), z[WEIGHTS:USUALLY]
    rows = z[ROWS:].reshape((RECORD, 4))
    count = int(min(s[FRAMES], RECORD))
    first = int(s[FRAMES]) - count
    start, left = rows[first % RECORD, 0], 0.0
    mean = np.zeros(3)
    for i in range(count):
        mean += rows[(first + i) % RECORD, 1:] / count
    s[USUAL] = rate
    s[RATES] = s[DEPTHS] = DIFFER**2
    for turn in range(_TURNS):
        x[0], x[1], x[2] = 0.0, s[USUAL], 1.0
        x[3:] = mean
        after, depth, left = np.zeros_like(T), 0.0, 0.0
        weights[:] = 0.0
        unknown(c, x, P, s[USUAL])
        before = start
        for i in range(count):
            row = rows[(first + i) % RECORD]
            place = row[1:] - x[3:]
            if turn == 0:
                x[0] = rate * (row[0] - start)
            else:
                go_on(c, s, x, P, row[0] - before)
                miss = c.miss * 2.0 ** (_TURNS - 1 - turn)
                e, _ = correct(x, P, T, row[1:], miss)
                left += (e * e).sum() / count
                place = row[1:] - x[3:] - (x[2] - 1.0) * template_at(T, x[0])[0]
            before = row[0]
            depth += x[2] / count
            learn(after, weights, x[0], place, 0.0)
        s[USUAL] = min(max(x[0] / (s[TIME] - start), 0.8 * rate), 1.25 * rate)
        T[:] = after * depth  # at the mean depth
        for _ in range(8 if turn < 2 else 1):  # breaths that differ leave steps in it
            T[:] = smoothed(T)
    s[SHARE], s[EVEN] = (1.0 if s[SHARE] > 0.0 else 1e-6), x[0]
    z[LOOSE:SPREAD] = x
    z[USUALLY:ROWS] = (0.35 * c.alarm) ** 2
    s[POWER], s[ALARM], s[TROUBLE] = c.noise**2, 0.0, 0.0
    s[MISFIT:AWAY] = 0.0
    return sqrt(left)
