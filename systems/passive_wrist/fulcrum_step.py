"""One step of the fulcrum tracker, compiled: policy round the filter's arithmetic.

What it decides, and why, stands in `fulcrum_tracker`; the layout of z as well.
"""

from math import cos, exp, pi, sin, sqrt

import numpy as np

from systems.common.compiled import compiled
from systems.passive_wrist.fulcrum_kernels import (
    add_to_record,
    innovate,
    predict,
    spread,
    update,
)

Floats = np.ndarray

BEFORE, FOLLOWING, BREATHING = 0.0, 1.0, 2.0
"""Phases."""
AUX = (
    *("phase", "steps", "unlikely", "guard", "nis", "recorded", "agreed", "found"),
    *("jumps", "refused", "force", "walk", "summed", "time", "due"),
)
"""Scalars of the tracker's state; `FulcrumTracker` says what they are."""
_PHASE, _STEPS, _UNLIKELY, _GUARD, _NIS, _RECORDED, _AGREED = range(7)
_JUMPS, _REFUSED, _FORCE, _WALK, _SUMMED, _TIME, _DUE = range(8, 15)
LEAST_BREATHING = 2e-4
"""Rms of the first harmonic from which there is breathing to speak of [m]."""
RECORD = 120
"""Entries of the record."""
WIDTH = 13
"""Numbers of an entry."""
_JUMP_NIS = 30.0  # normalised innovation squared of a jump
_GUARD_TIME = 0.1  # s after a jump in which only the mean is updated
_GUARD_WALK = 0.05  # m/sqrt(s): the rest of a jump that takes more than two samples
_LARGEST_JUMP = 0.02  # [m]
_UNDERSTOOD = 4.0  # times the force above which the stiffness is learnt
_DEPTH_UNKNOWN = 6e-3  # [m] sigma along the shaft


@compiled
def to_first_force(
    x: Floats, P: Floats, a: Floats, guess_sigma: float, noise: Floats
) -> None:
    """Puts the mean on the line that a sample's force implies; its depth is kept."""
    n = len(x)
    K = exp(x[n - 1])
    u, f = a[3:6], a[12:15]
    depth = push = 0.0
    for i in range(3):
        depth += u[i] * (x[i] - a[i])
        push += u[i] * f[i]
    offset = (f - push * u) / K
    side = (noise[0] / K) ** 2 + noise[4] ** 2
    sigma2 = P[n - 1, n - 1]
    x[0:3] = a[0:3] + depth * u + offset
    P[0:3, :] = 0.0
    P[:, 0:3] = 0.0
    for i in range(3):
        for j in range(3):
            # An unknown stiffness leaves the offset along the force unknown with it.
            P[i, j] = (guess_sigma**2 - side) * u[i] * u[j]
            P[i, j] += sigma2 * offset[i] * offset[j]
        P[i, i] += side
        P[i, n - 1] = P[n - 1, i] = -sigma2 * offset[i]


@compiled
def follow_jump(
    x: Floats, P: Floats, a: Floats, noise: Floats, depth_above: float, size: float
) -> None:
    """The wall has jumped by about `size` m: fits the mean alone, iterated."""
    for i in range(3):
        P[i, i] += size**2
    prior = x[0:3].copy()
    for _ in range(4):
        y, H, S, HP, gain, _, _, _ = innovate(x, P, a, noise, depth_above)
        # The innovation seen from the prior, linearised at the iterate.
        for j in range(4):
            for i in range(3):
                y[j] += H[j, i] * (x[i] - prior[i])
        for i in range(3):
            x[i] = prior[i]
            for j in range(4):
                x[i] += gain[i, j] * y[j]
    x[0:3] = prior
    update(x, P, y, S, HP, gain, a[3:6], 1.0, 3)


@compiled
def sample_at(shaft: Floats, wrench: Floats, c) -> Floats:  # type: ignore[no-untyped-def]
    """A reading as a sample; its angle counts while the tip moves across the shaft."""
    a = np.empty(21)
    a[0:12] = shaft
    a[12:18] = wrench[0:6]
    a[18], a[19] = c.damping, 1.0
    v = shaft[6:9] + c.length * shaft[9:12]
    along = v[0] * shaft[3] + v[1] * shaft[4] + v[2] * shaft[5]
    speed2 = v[0] ** 2 + v[1] ** 2 + v[2] ** 2 - along**2
    speed = sqrt(max(speed2, 0.0))
    a[20] = min(max(speed / c.depth_speed - 1.0, 0.0), 1.0)
    return a


@compiled
def report(packed: Floats, z: Floats, u: Floats, time: float) -> Floats:
    """The estimate at a time (14).

    p_WI and v_WI; sigma across the shaft u and along it; stiffness and sigma of its
    logarithm; breathing rate; phase, jumps followed, estimates refused.
    """
    c = packed[0]
    n = 5 + 6 * int(c.harmonics)
    i_record = n + n * n
    aux = z[i_record + (RECORD + 1) * WIDTH :]
    x, P = z[:n], z[n:i_record].reshape(n, n)
    omega, K = exp(x[n - 2]), exp(x[n - 1])
    ahead = max(0.0, time - aux[_TIME]) + c.latency
    r = np.empty(14)
    for j in range(3):
        r[j], r[3 + j] = x[j], 0.0
        for k in range(int(c.harmonics)):
            w = (k + 1) * omega
            co, si = cos(w * ahead), sin(w * ahead)
            a, b = x[3 + 6 * k + j], x[6 + 6 * k + j]
            r[j] += a * co - b * si
            r[3 + j] -= w * (a * si + b * co)
    r[6], r[7] = spread(P, u, 0.5 * c.force_bias / K)
    r[8], r[9] = K, sqrt(P[n - 1, n - 1])
    seen = aux[_PHASE] == BREATHING and aux[len(AUX)] >= LEAST_BREATHING
    r[10] = omega / (2.0 * pi) if seen else 0.0
    r[11], r[12], r[13] = aux[_PHASE], aux[_JUMPS], aux[_REFUSED]
    return r


@compiled
def advance(
    packed: Floats, old: Floats, shaft: Floats, wrench: Floats, time: float
) -> Floats:
    """The tracker's next state.

    Args:
        packed: `FulcrumParams`, with `every`: samples in an entry of the record.
        old: State z.
        shaft: p_WS, u, v_WS, du (12).
        wrench: f, m, and 1 if they are valid (7).
        time: In s.
    """
    c = packed[0]
    n = 5 + 6 * int(c.harmonics)
    i_record = n + n * n
    i_sums = i_record + RECORD * WIDTH
    i_aux = i_sums + WIDTH
    i_parts = i_aux + len(AUX)
    z = old.copy()
    x, P = z[:n], z[n:i_record].reshape(n, n)
    sums, aux = z[i_sums:i_aux], z[i_aux:i_parts]
    parts = c.amplitude_walk * np.maximum(z[i_parts:], 3e-4)
    noise = np.array(
        (c.force_noise, c.moment_noise, c.force_bias, c.moment_bias, c.pose_noise)
    )
    aux[_TIME], aux[_DUE] = time, 0.0
    known = aux[_PHASE] == BREATHING
    walk = aux[_WALK] * min(max(aux[_NIS], 1.0), 10.0) if known else c.wall_walk
    valid = wrench[6] > 0.5 and np.isfinite(wrench).all() and np.isfinite(shaft).all()
    if not valid:
        if aux[_PHASE] != BEFORE:
            predict(x, P, c.period, walk, parts, known)
            aux[_RECORDED] = aux[_SUMMED] = 0.0  # a record must have no gaps
            sums[:] = 0.0
        return z
    a = sample_at(shaft, wrench, c)
    u, f = shaft[3:6], wrench[0:3]
    push = f[0] * u[0] + f[1] * u[1] + f[2] * u[2]
    force = sqrt(max(f[0] ** 2 + f[1] ** 2 + f[2] ** 2 - push**2, 0.0))
    aux[_FORCE] = force
    aux[_STEPS] += 1.0
    if aux[_PHASE] == BEFORE:
        to_first_force(x, P, a, c.guess_sigma, noise)
        aux[_PHASE] = FOLLOWING
        return z
    guard = aux[_GUARD] > 0.0
    if guard:
        aux[_GUARD] -= c.period
        walk = _GUARD_WALK
    predict(x, P, c.period, walk, parts, known)
    if not known:
        # A wall that breathes unseen under a turning shaft looks like a depth error:
        # angles are heard only while the depth is hardly known at all.
        sigma = spread(P, u, 0.0)[1]
        a[20] *= min(max(sigma / _DEPTH_UNKNOWN - 1.0, 0.0), 1.0)
    y, _, S, HP, gain, w, nis, seen = innovate(x, P, a, noise, c.depth_above)
    if nis < 0.0:
        raise ValueError("fulcrum estimator: a covariance is not positive definite")
    if nis > _JUMP_NIS and not guard:
        aux[_UNLIKELY] += 1.0
        if aux[_UNLIKELY] < 2.0:
            return z  # coasted over: one unlikely sample
        size = 1.5 * sqrt(y[0] ** 2 + y[1] ** 2) / exp(x[n - 1])
        follow_jump(x, P, a, noise, c.depth_above, min(_LARGEST_JUMP, size))
        aux[_UNLIKELY], aux[_GUARD], aux[_RECORDED] = 0.0, _GUARD_TIME, 0.0
        aux[_JUMPS] += 1.0
    else:
        aux[_UNLIKELY] = 0.0
        aux[_NIS] += 0.02 * (min(nis, 60.0) / 4.0 - aux[_NIS])
        # Once the wall is understood, force is mostly what the prediction missed of
        # its motion, and says less of its stiffness.
        least = c.learn_above * (_UNDERSTOOD if known else 1.0)
        held = 3 if guard else (n if force > least else n - 1)
        update(x, P, y, S, HP, gain, u, max(seen, a[20]), held)
    add_to_record(sums, x, a, w)
    aux[_SUMMED] += 1.0
    if aux[_SUMMED] >= c.every:
        z[i_record : i_sums - WIDTH] = z[i_record + WIDTH : i_sums].copy()
        z[i_sums - WIDTH : i_sums] = sums / aux[_SUMMED]
        sums[:], aux[_SUMMED] = 0.0, 0.0
        aux[_RECORDED] = min(aux[_RECORDED] + 1.0, RECORD)
        aux[_DUE] = 1.0
    far = 0.0
    for i in range(3):
        p = x[i]
        for k in range(3, n - 2, 6):
            p += x[k + i]
        far += (p - c.guess[i]) ** 2
    if far > c.neighbourhood**2:  # refused: starts anew
        aux[_REFUSED] += 1.0
        aux[_PHASE], aux[_GUARD], aux[_RECORDED], aux[_AGREED] = (
            FOLLOWING,
            0.0,
            0.0,
            0.0,
        )
        x[0:3] = c.guess
        x[3 : n - 2] = 0.0
        own = P[n - 1, n - 1]
        P[:] = 0.0
        P[n - 1, n - 1] = own
        to_first_force(x, P, a, c.guess_sigma, noise)
    return z
