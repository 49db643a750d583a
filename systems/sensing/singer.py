"""Singer's model of a moving hand, and a Kalman filter over it.

Along each axis the state is position, velocity and acceleration; the acceleration is
a first-order Markov process of time constant 1/alpha and standard deviation sigma
(Singer 1970). Noise and model are the same along all axes, so the three axes share
one covariance, whose six entries are (pp, pv, pa, vv, va, aa).
"""

import math

from systems.common.compiled import compiled

type Covariance = tuple[float, float, float, float, float, float]


@compiled
def predict_covariance(
    P: Covariance, dt: float, alpha: float, sigma: float
) -> Covariance:
    """Covariance after `dt`: Phi P Phi' + Q (Bar-Shalom 2001, section 8.2).

    Args:
        P: Now, (pp, pv, pa, vv, va, aa) in m, s.
        dt: Time ahead in s, >= 0.
        alpha: Inverse of the acceleration's time constant in 1/s.
        sigma: Standard deviation of the acceleration in m/s^2.
    """
    pp, pv, pa, vv, va, aa = P
    x = alpha * dt
    e = math.exp(-x)
    b = (1.0 - e) / alpha  # velocity after a unit of acceleration
    a = (x - 1.0 + e) / (alpha * alpha)  # position after a unit of acceleration
    s2 = sigma * sigma
    e2 = e * e
    k = s2 / (alpha * alpha)
    # Phi P: rows of position and velocity against (p, v, a).
    rp = pp + dt * pv + a * pa
    rv = pv + dt * vv + a * va
    ra = pa + dt * va + a * aa
    sv = vv + b * va
    sa = va + b * aa
    return (
        rp
        + dt * rv
        + a * ra
        + k
        / (alpha * alpha)
        * (1.0 - e2 + 2.0 * x + x * x * (x / 1.5 - 2.0) - 4.0 * x * e),
        rv + b * ra + k / alpha * (e2 + 1.0 - 2.0 * e + 2.0 * x * (e - 1.0) + x * x),
        e * ra + k * (1.0 - e2 - 2.0 * x * e),
        sv + b * sa + k * (4.0 * e - 3.0 - e2 + 2.0 * x),
        e * sa + s2 / alpha * (e2 + 1.0 - 2.0 * e),
        e2 * aa + s2 * (1.0 - e2),
    )


@compiled
def gains(dt: float, alpha: float) -> tuple[float, float, float]:
    """What a unit of acceleration gives after `dt`: position, velocity, itself.

    The mean moves as p + dt v + gains[0] a, v + gains[1] a, gains[2] a.
    """
    x = alpha * dt
    e = math.exp(-x)
    return (x - 1.0 + e) / (alpha * alpha), (1.0 - e) / alpha, e


@compiled
def correct_covariance(
    P: Covariance, variance: float
) -> tuple[Covariance, tuple[float, float, float]]:
    """Covariance after a position measurement, and the Kalman gain.

    Args:
        P: Before, (pp, pv, pa, vv, va, aa).
        variance: Of the measurement along each axis in m^2.

    Returns:
        The covariance, and the gains for position, velocity and acceleration.
    """
    pp, pv, pa, vv, va, aa = P
    s = pp + variance
    kp, kv, ka = pp / s, pv / s, pa / s
    rest = variance / s
    return (
        (rest * pp, rest * pv, rest * pa, vv - kv * pv, va - kv * pa, aa - ka * pa),
        (kp, kv, ka),
    )
