"""What keeps the fulcrum's estimate good for minutes, compiled.

An unloaded shaft sees the fulcrum across itself alone: what lies along it is known from
the shaft's turning. A tip that follows an organ turns the shaft at the breathing's own
rate, and then mean depth and depth's breath are indistinguishable. The filter does not
know that, takes the turning for a message, and drifts along the shaft by a quarter of a
millimetre a second, until its estimate is refused. Four things mend it:

- *gate*: an observer learns what of the tip's motion repeats with the breath (mean and
  harmonics); only speed that it does not explain tells of the depth;
- *leak*: along the shaft the mean is drawn to the depth that was last told, and the
  breath to zero, so weakly that whatever is really seen prevails;
- *bias*: force and moment belong to one contact; what they slowly disagree by is the
  sensor's drift, and is taken from the force;
- a *refusal* concerns the distance across the shaft alone.
"""

from math import cos, sin

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import across, along, cross, dot, norm, over, sub, xyz
from systems.common.signal import Vector
from systems.passive_wrist.fulcrum_kernels import LN_K, Sample

Floats = np.ndarray
OVERTONES = 8
"""Harmonics of the observer of the tip."""
REFERENCE, BIAS, TOLD, TIP = 0, 1, 4, 5
"""Places: depth last told in m, bias of the force in N (3), 1 once there is a depth,
and the observer: mean (3), and two parts (3 each) a harmonic."""
SIZE = TIP + 3 + 6 * OVERTONES
_LEARNT = 8.0  # s: time constant of the observer
_FOLLOWED = 2.0  # s: of the reference, while the depth is told
_LEAK = 20.0  # s
_LEAK_SIGMA = 0.010  # m
_BIAS_TIME = 20.0  # s
_BIAS_FORCE = 0.5  # N: over it force and moment disagree for other reasons as well
_FARTHEST = 0.05  # m along the shaft


@compiled
def unexplained(s: Floats, p: Vector, v: Vector, omega: float, dt: float) -> Vector:
    """Updates the observer of the tip; the velocity that it does not explain.

    Args:
        s: State of this module (SIZE), changed in place.
        p: Place of the tip in m.
        v: Its velocity in m/s.
        omega: The breathing's angular rate in rad/s.
        dt: Since the last update, in s.
    """
    if s[TOLD] == 0.0:
        for i in range(3):
            s[TIP + i] = p[i]
    e = sub(p, xyz(s, TIP))
    rest = v
    for k in range(1, OVERTONES + 1):
        at = TIP + 3 + 6 * (k - 1)
        c, d = cos(k * omega * dt), sin(k * omega * dt)
        for i in range(at, at + 3):
            a, b = s[i], s[i + 3]
            s[i], s[i + 3] = a * c - b * d, a * d + b * c
        e = sub(e, xyz(s, at))
        rest = along(rest, k * omega, xyz(s, at + 3))
    for i in range(3):
        s[TIP + i] += dt / _LEARNT * e[i]
        for k in range(OVERTONES):
            s[TIP + 3 + 6 * k + i] += 2.0 * dt / _LEARNT * e[i]
    return rest


@compiled
def unbiased(s: Floats, a: Sample, depth: float, dt: float) -> Vector:
    """The sample's force without its bias, which is learnt.

    Args:
        s: State of this module, changed in place.
        a: The sample.
        depth: Of the contact from the sensor in m.
        dt: In s.
    """
    f = across(a.f, a.u)
    if norm(f) < _BIAS_FORCE and depth > 0.05:
        other = sub(sub(f, over(cross(a.m, a.u), depth)), xyz(s, BIAS))
        for i in range(3):
            s[BIAS + i] += dt / _BIAS_TIME * other[i]
    return sub(a.f, across(xyz(s, BIAS), a.u))


@compiled
def _pull(x: Floats, P: Floats, place: int, u: Vector, wanted: float, R: float) -> None:
    """A pseudo-measurement u . x[place:place + 3] = wanted; ln K is not touched."""
    n = len(x)
    h = np.zeros(n)
    for j in range(n):
        for i in range(3):
            h[j] += P[j, place + i] * u[i]
    S = R + u[0] * h[place] + u[1] * h[place + 1] + u[2] * h[place + 2]
    y = wanted - dot(u, xyz(x, place))
    gain = h / S
    gain[LN_K] = 0.0
    # Joseph's form for a scalar: P - g h' - h g' + S g g'.
    for i in range(n):
        x[i] += gain[i] * y
        for j in range(n):
            P[i, j] += S * gain[i] * gain[j] - gain[i] * h[j] - h[i] * gain[j]


@compiled
def leak(
    s: Floats, x: Floats, P: Floats, u: Vector, guess: Vector, told: float, dt: float
) -> None:
    """Draws depth and its breath to what was last told, in place.

    Args:
        s: State of this module.
        x: The filter's state.
        P: Its covariance.
        u: The shaft.
        guess: Depths count from it.
        told: How much this sample tells of the depth, in [0, 1].
        dt: In s.
    """
    depth = dot(u, sub(xyz(x, 0), guess))
    if s[TOLD] == 0.0:
        s[TOLD], s[REFERENCE] = 1.0, depth
    s[REFERENCE] += told * dt / _FOLLOWED * (depth - s[REFERENCE])
    s[REFERENCE] = min(max(s[REFERENCE], -_FARTHEST), _FARTHEST)
    if told > 0.5:
        return
    R = _LEAK_SIGMA**2 * _LEAK / dt
    _pull(x, P, 0, u, s[REFERENCE] + dot(u, guess), R)
    for i in range(3, len(x) - 2, 3):
        _pull(x, P, i, u, 0.0, 0.5 * R)
