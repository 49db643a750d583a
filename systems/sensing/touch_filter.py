"""What a touch weighs, by a Kalman filter: the sensor's zero, and the tissue.

    m_I = m_0 + F (p_P - p_I) x n + noise,   F = k d - g,

d being how deep the tip is where the organ is thought to be. State x (5): the zero m_0
(3), which drifts as the sensor does; k; and g, which is k times what the surface is
lower than thought. The last two stay, so that neither noise nor drift reaches F as
long as d does not change; what is left of both is the error of the step in m_I when
the organ is touched, and less of it after each further touch.
"""

from math import sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import Vector, dot

K, G, SIZE = 3, 4, 5
Floats = np.ndarray


def prior(c: Any, length: float) -> Floats:
    """Mean and, below it, covariance before the first reading, (6, 5).

    Args:
        c: `TissueForceParams`.
        length: From the sensor to the tip, m: no fulcrum is farther.
    """
    belief = np.zeros((SIZE + 1, SIZE))
    belief[0, K] = c.stiffness
    zero = c.moment_bias**2 + (length * c.force_bias) ** 2
    k, g = c.stiffness_doubt * c.stiffness, c.stiffness * c.surface_doubt
    belief[1:] = np.diag([zero, zero, zero, k**2, g**2])
    return belief


@compiled
def pressing(belief: Floats, depth: float) -> float:
    """F in N, at a depth in m."""
    return max(0.0, belief[0, K] * depth - belief[0, G])


@compiled
def doubt(belief: Floats, depth: float) -> float:
    """Standard deviation of F in N, at a depth in m."""
    P = belief[1:]
    of_g = P[G, G] - 2.0 * depth * P[K, G]
    return sqrt(max(0.0, depth * depth * P[K, K] + of_g))


@compiled
def weigh(
    c: Any, belief: Floats, m_I: Vector, reach: float, arm: Vector, depth: float
) -> Floats:
    """The belief after a reading.

    Args:
        c: A record of `TissueForceParams`.
        belief: See `prior`.
        m_I: Moment about the fulcrum, N m.
        reach: From the sensor to the fulcrum, m: by it the force's noise counts.
        arm: (p_P - p_I) x n in m; zero where nothing can be touched.
        depth: d, m.
    """
    out = belief.copy()
    x, P = out[0], out[1:]
    drift = c.moment_drift**2 + (reach * c.force_drift) ** 2
    noise = c.moment_noise**2 + (reach * c.force_noise) ** 2
    touches = dot(arm, arm) > 0.0 and pressing(belief, depth) > 0.0
    h = np.zeros(SIZE)
    for i in range(3):
        P[i, i] += c.period * drift
    for i in range(3):
        h[:] = 0.0
        h[i] = 1.0
        if touches:
            h[K], h[G] = arm[i] * depth, -arm[i]
        Ph = np.zeros(SIZE)
        for j in range(SIZE):
            for k in range(SIZE):
                Ph[j] += P[j, k] * h[k]
        square, misfit = noise, m_I[i]
        for j in range(SIZE):
            square += h[j] * Ph[j]
            misfit -= h[j] * x[j]
        for j in range(SIZE):
            x[j] += Ph[j] * misfit / square
            for k in range(SIZE):
                P[j, k] -= Ph[j] * Ph[k] / square
    x[K] = max(0.0, x[K])
    return out
