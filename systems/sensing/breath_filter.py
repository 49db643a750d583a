"""A breath that is like no other: phase, rate, depth and offset within a template.

    p(t) = b + d T(phi(t)),   phi' = omega,

by an extended Kalman filter; the usual omega, and how far breaths differ, are its
owner's to learn. Here is the owner's state as well, see `organ_estimator`.
"""

from math import floor, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled

BINS = 100
"""Of the template."""
RECORD = 720
"""Frames that are remembered."""
DIFFER = 0.08
"""By which breaths may differ until that is learnt."""
_FEWEST, _MOST = 0.7, 1.4  # of the usual, that a breath's rate and depth may be

Floats = np.ndarray

SCALARS = (
    *("time", "frames", "share", "power", "alarm", "due"),
    *("trouble", "usual", "rates", "depths", "even"),
)
"""Time of the last frame in s; frames so far; share of the template that is in use;
smoothed square of the misfit; 1 in alarm; frames until the next search; share of
the last seconds in alarm; usual omega; mean squares by which omega (relative to it) and
d differ from the usual; a phase that goes on more evenly than phi."""
(TIME, FRAMES, SHARE, POWER, ALARM, DUE, TROUBLE, USUAL, RATES, DEPTHS, EVEN) = range(
    len(SCALARS)
)
MISFIT = len(SCALARS)  # smoothed, as if it were noise alone (3)
LOST = MISFIT + 3  # likewise, of the loose breath, as it is (3)
AWAY = LOST + 3  # of what was said before another breath was found, dies away (3)
PLAIN = AWAY + 3  # p, v of the plain track (6)
BREATH = PLAIN + 6  # phi in breaths, omega in 1/s, d, b
PHI, OMEGA, DEPTH, OFFSET = BREATH, BREATH + 1, BREATH + 2, BREATH + 3
ORDER = 6
LOOSE = BREATH + ORDER  # the same, not corrected but drawn after it (ORDER)
SPREAD = LOOSE + ORDER  # its covariance (ORDER, ORDER)
TEMPLATE = SPREAD + ORDER * ORDER  # (BINS, 3)
WEIGHTS = TEMPLATE + 3 * BINS
USUALLY = WEIGHTS + BINS  # mean square of the loose breath's misfit (BINS)
ROWS = USUALLY + BINS  # (RECORD, 4): time and place of the frames, a ring
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
def smoothed(T: Floats) -> Floats:
    """The template with each bin a half its own and a quarter each neighbour's."""
    out = np.empty_like(T)
    for k in range(len(T)):
        out[k] = 0.25 * T[k - 1] + 0.5 * T[k] + 0.25 * T[(k + 1) % len(T)]
    return out


@compiled
def unknown(c: Any, x: Floats, P: Floats, usual: float) -> None:
    """The breath's spread where phase, rate and depth have just been found."""
    P[:] = 0.0
    for k in range(ORDER):
        P[k, k] = c.offset_walk**2
    P[0, 0] = 0.02**2
    P[1, 1] = (DIFFER * usual) ** 2
    P[2, 2] = DIFFER**2


@compiled
def go_on(c: Any, s: Floats, x: Floats, P: Floats, dt: float) -> None:
    """The breath and its spread after a time: omega and d tend to the usual."""
    left = max(1.0 - s[USUAL] * dt, 0.0)
    x[0] += dt * x[1]
    x[1] = s[USUAL] * (1.0 + left * (min(max(x[1] / s[USUAL], _FEWEST), _MOST) - 1.0))
    x[2] = 1.0 + left * (x[2] - 1.0)
    for j in range(ORDER):
        P[0, j] += dt * P[1, j]
    for j in range(ORDER):
        P[j, 0] += dt * P[j, 1]
    for k in (1, 2):
        for j in range(ORDER):
            P[k, j] *= left
            P[j, k] *= left
    P[1, 1] += 2.0 * s[USUAL] ** 3 * dt * s[RATES]
    P[2, 2] += 2.0 * s[USUAL] * dt * s[DEPTHS]
    for k in range(3, ORDER):
        P[k, k] += dt * c.offset_walk**2


@compiled
def correct(
    x: Floats, P: Floats, T: Floats, z: Floats, miss: float
) -> tuple[Floats, Floats]:
    """The filter's step with a place z that is seen, in place.

    Returns:
        The misfit, and what it would be if noise were all that is not known.
    """
    value, slope = template_at(T, x[0])
    e = z - x[3:] - x[2] * value
    plain, dx = np.empty(3), np.zeros(ORDER)
    h, Ph = np.zeros(ORDER), np.zeros(ORDER)
    for i in range(3):  # the axes one after the other
        h[:] = 0.0
        h[0], h[2], h[3 + i] = x[2] * slope[i], value[i], 1.0
        power, left = miss**2, e[i]
        for j in range(ORDER):
            Ph[j] = 0.0
            for k in range(ORDER):
                Ph[j] += P[j, k] * h[k]
            power += h[j] * Ph[j]
            left -= h[j] * dx[j]
        plain[i] = left * miss / sqrt(power)
        for j in range(ORDER):
            dx[j] += Ph[j] * left / power
            for k in range(ORDER):
                P[j, k] -= Ph[j] * Ph[k] / power
    x += dx
    x[2] = min(max(x[2], _FEWEST), _MOST)
    return e, plain


@compiled
def report(z: Floats, time: float) -> Floats:
    """The elements of `OrganMotion` at a time in s."""
    s, x, T = z[:TEMPLATE], z[BREATH:LOOSE], z[TEMPLATE:WEIGHTS].reshape((BINS, 3))
    out = np.zeros(9)
    ahead = max(0.0, time - s[TIME])
    known = s[SHARE] > 0.0
    out[0:3] = x[3:] + s[AWAY:PLAIN]
    if s[ALARM] == 1.0:
        out[0:3] = s[PLAIN : PLAIN + 3] + ahead * s[PLAIN + 3 : PLAIN + 6]
        out[3:6] = s[PLAIN + 3 : PLAIN + 6]
    elif known:
        value, slope = template_at(T, x[0] + x[1] * ahead)
        share = s[SHARE] * s[SHARE] * (3.0 - 2.0 * s[SHARE]) * x[2]
        out[0:3] += share * value
        out[3:6] = share * x[1] * slope
    out[6] = sqrt(s[POWER]) if known else 1.0
    out[7] = 1.0 if s[SHARE] == 1.0 and s[ALARM] == 0.0 else 0.0
    out[8] = s[ALARM]
    return out
