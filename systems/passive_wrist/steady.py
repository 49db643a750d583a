"""What keeps the fulcrum's estimate good for minutes, compiled.

An unloaded shaft sees the fulcrum across itself alone: what lies along it is known from
the shaft's turning. A tip that follows an organ turns the shaft with the breathing, and
what of the wall's wave the filter does not foresee (it has two harmonics, and a breath
is not like the one before) is then explained as well by a depth at which the shaft does
not move. The filter drifts there, or jumps, and a pivot that has to follow by
centimetres passes the true fulcrum on its way. Once the wall's breath is known:

- the shaft's turning tells nothing of the depth, a side force alone does;
- *leak*: along the shaft the mean is drawn to the depth that was last told, and the
  breath to zero, so weakly that whatever is really seen prevails;
- a *refusal* concerns the distance across the shaft alone.

What the sensor drifts by is `sensor_zero`'s.
"""

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import dot, sub, xyz
from systems.common.signal import Vector
from systems.passive_wrist.fulcrum_kernels import LN_K

Floats = np.ndarray
REFERENCE, TOLD, SIZE = 0, 1, 2
"""Places: depth last told in m, 1 once there is one; and their number."""
_FOLLOWED = 2.0  # s: of the reference, while the depth is told
_LEAK = 20.0  # s
_LEAK_SIGMA = 0.010  # m
_FARTHEST = 0.05  # m along the shaft


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
