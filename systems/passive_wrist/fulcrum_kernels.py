"""The fulcrum filter's arithmetic, compiled.

Small matrices at every control step: in numpy three quarters of the time go into
calls. Compiled it is an eighth, and filtering a record of twelve seconds again fits
into a control period. The state's layout stands in `fulcrum_filter`.

A sample is a vector of 21: p_WS, u, v_WS, du, f, m (3 each), the wall's damping, the
number of readings that f and m are the mean of, and the weight of its angle.
"""

from functools import lru_cache
from math import cos, exp, sin, sqrt

import numpy as np

from systems.common.compiled import compiled
from systems.passive_wrist.wall_model import lateral_basis

_basis = compiled(lateral_basis)

Floats = np.ndarray


@compiled
def predict(
    x: Floats, P: Floats, dt: float, walk: float, parts: Floats, breathing: bool
) -> None:
    """Moves (x, P) by dt, in place; walks in m/sqrt(s), of the mean and the parts."""
    n = len(x)
    if breathing:
        theta = exp(x[n - 2]) * dt
        F = np.eye(n)
        for k in range(len(parts)):
            c, s = cos((k + 1) * theta), sin((k + 1) * theta)
            for i in range(3 + 6 * k, 6 + 6 * k):
                a, b = x[i], x[i + 3]
                F[i, i] = F[i + 3, i + 3] = c
                F[i, i + 3], F[i + 3, i] = -s, s
                x[i], x[i + 3] = a * c - b * s, a * s + b * c
                F[i, n - 2] = -(k + 1) * theta * x[i + 3]
                F[i + 3, n - 2] = (k + 1) * theta * x[i]
        P[:] = F @ P @ F.T
        for k in range(len(parts)):
            for i in range(3 + 6 * k, 9 + 6 * k):
                P[i, i] += parts[k] ** 2 * dt
        P[n - 2, n - 2] += 3e-5 * dt
    for i in range(3):
        P[i, i] += walk**2 * dt
    P[n - 1, n - 1] += 1e-4 * dt


@compiled
def lateral_slope(
    f1: float, f2: float, depth: float, u: Floats, e1: Floats, e2: Floats, k: float
) -> Floats:
    """Derivative (4, 3) of (f1, f2, m1, m2) by p_I, without the damping's part."""
    J = np.empty((4, 3))
    for i in range(3):
        J[0, i] = k * e1[i]
        J[1, i] = k * e2[i]
        J[2, i] = -f2 * u[i] - k * depth * e2[i]
        J[3, i] = f1 * u[i] + k * depth * e1[i]
    return J


@compiled
def innovate(x: Floats, P: Floats, a: Floats, noise: Floats, depth_above: float):  # type: ignore[no-untyped-def]
    """Compares a sample with the state.

    Args:
        x: State (n).
        P: Covariance (n, n).
        a: Sample (21).
        noise: Standard deviations of force, moment, force bias, moment bias, pose.
        depth_above: Force from which the moment says something of the depth, in N.

    Returns:
        y (4), H (4, n), S (4, 4), H P (4, n), gain (n, 4), wall against shaft at
        the contact (3), normalised innovation squared (negative if S is not
        positive definite), and how much the moment says of the depth, in [0, 1].
    """
    n = len(x)
    K, omega = exp(x[n - 1]), exp(x[n - 2])
    u = a[3:6]
    e1, e2 = _basis(u)
    r, w = x[0:3] - a[0:3], -a[6:9]
    for k in range((n - 5) // 6):
        for j in range(3):
            r[j] += x[3 + 6 * k + j]
            w[j] -= (k + 1) * omega * x[6 + 6 * k + j]
    depth = u[0] * r[0] + u[1] * r[1] + u[2] * r[2]
    w = w - depth * a[9:12]
    k1 = K * (e1[0] * r[0] + e1[1] * r[1] + e1[2] * r[2])
    k2 = K * (e2[0] * r[0] + e2[1] * r[1] + e2[2] * r[2])
    f1 = k1 + a[18] * (e1[0] * w[0] + e1[1] * w[1] + e1[2] * w[2])
    f2 = k2 + a[18] * (e2[0] * w[0] + e2[1] * w[1] + e2[2] * w[2])
    # At forces in the noise the moment's slope by the depth is a guess that
    # multiplies itself and would pull the depth towards the sensor.
    seen = min(max(sqrt(f1 * f1 + f2 * f2) / depth_above - 1.0, 0.0), 1.0)
    J = lateral_slope(seen * f1, seen * f2, depth, u, np.array(e1), np.array(e2), K)
    H = np.zeros((4, n))
    H[:, 0:3] = J
    for i in range(3, n - 2, 6):
        H[:, i : i + 3] = J
    H[0, n - 1], H[1, n - 1] = k1, k2
    H[2, n - 1], H[3, n - 1] = -depth * k2, depth * k1
    HP = H @ P
    S = HP @ H.T
    pose = (K * noise[4]) ** 2
    rf = (noise[0] ** 2 + pose) / a[19] + noise[2] ** 2
    rm = (noise[1] ** 2 + depth**2 * pose) / a[19] + noise[3] ** 2
    for i in range(2):
        S[i, i] += rf
        S[i + 2, i + 2] += rm
    f, m = a[12:15], a[15:18]
    y = np.empty(4)
    y[0] = e1[0] * f[0] + e1[1] * f[1] + e1[2] * f[2] - f1
    y[1] = e2[0] * f[0] + e2[1] * f[1] + e2[2] * f[2] - f2
    y[2] = e1[0] * m[0] + e1[1] * m[1] + e1[2] * m[2] + depth * f2
    y[3] = e2[0] * m[0] + e2[1] * m[1] + e2[2] * m[2] - depth * f1
    b = np.empty((4, n + 1))
    b[:, :n] = HP
    b[:, n] = y
    sound = _solve(S.copy(), b)
    nis = y[0] * b[0, n] + y[1] * b[1, n] + y[2] * b[2, n] + y[3] * b[3, n]
    return y, H, S, HP, b[:, :n].T.copy(), w, nis if sound else -1.0, seen


@compiled
def _solve(S: Floats, b: Floats) -> bool:
    """S^-1 b in place by Cholesky; False if S is not positive definite."""
    for i in range(4):
        for j in range(i + 1):
            s = S[i, j]
            for k in range(j):
                s -= S[i, k] * S[j, k]
            if i > j:
                S[i, j] = s / S[j, j]
            elif not s > 0.0:
                return False
            else:
                S[i, i] = sqrt(s)
    for i in range(4):
        for k in range(i):
            b[i] -= S[i, k] * b[k]
        b[i] /= S[i, i]
    for i in range(3, -1, -1):
        for k in range(i + 1, 4):
            b[i] -= S[k, i] * b[k]
        b[i] /= S[i, i]
    return True


@compiled
def update(
    x: Floats,
    P: Floats,
    y: Floats,
    S: Floats,
    HP: Floats,
    gain: Floats,
    u: Floats,
    axial: float,
    held: int,
) -> None:
    """Kalman update in place; see `FulcrumFilter.update`."""
    n = len(x)
    gain[held:] = 0.0
    if axial < 1.0:
        for i in range(0, n - 2, 3):
            for j in range(4):
                along = (1.0 - axial) * (
                    u[0] * gain[i, j] + u[1] * gain[i + 1, j] + u[2] * gain[i + 2, j]
                )
                for k in range(3):
                    gain[i + k, j] -= along * u[k]
    x += gain @ y
    # P + K S K^T - K H P - (K H P)^T, so written that rounding grows no skew.
    half = gain @ (0.5 * (S @ gain.T) - HP)
    for i in range(n):
        for j in range(i + 1):
            value = 0.5 * (P[i, j] + P[j, i]) + half[i, j] + half[j, i]
            P[i, j] = P[j, i] = value


@compiled
def add_to_record(sums: Floats, x: Floats, a: Floats, w: Floats) -> None:
    """Adds a sample to the sums of a record's entry, the damping's part taken out.

    An entry is p_WS, u, f, m (lateral) and the weight of the angle.
    """
    u = a[3:6]
    e1, e2 = _basis(u)
    d1 = d2 = f1 = f2 = m1 = m2 = depth = 0.0
    for i in range(3):
        d1 += a[18] * e1[i] * w[i]
        d2 += a[18] * e2[i] * w[i]
        f1 += e1[i] * a[12 + i]
        f2 += e2[i] * a[12 + i]
        m1 += e1[i] * a[15 + i]
        m2 += e2[i] * a[15 + i]
        depth += u[i] * (x[i] - a[i])
    f1, f2, m1, m2 = f1 - d1, f2 - d2, m1 + depth * d2, m2 - depth * d1
    for i in range(3):
        sums[i] += a[i]
        sums[3 + i] += u[i]
        sums[6 + i] += f1 * e1[i] + f2 * e2[i]
        sums[9 + i] += m1 * e1[i] + m2 * e2[i]
    sums[12] += a[20]


@compiled
def sample_of(entry: Floats, averaged: int) -> Floats:
    """A record's entry as a sample."""
    a = np.zeros(21)
    a[0:3] = entry[0:3]
    a[3:6] = entry[3:6] / sqrt((entry[3:6] ** 2).sum())
    a[12:18] = entry[6:12]
    a[19], a[20] = averaged, entry[12]
    return a


@compiled
def filter_record(
    x: Floats,
    P: Floats,
    record: Floats,
    dt: float,
    averaged: int,
    walk: float,
    parts: Floats,
    noise: Floats,
    depth_above: float,
) -> bool:
    """Filters a record (m, 13) in place; False if a covariance went wrong."""
    for i in range(1, len(record)):
        predict(x, P, dt, walk, parts, True)
        a = sample_of(record[i], averaged)
        y, _, S, HP, gain, _, nis, seen = innovate(x, P, a, noise, depth_above)
        if nis < 0.0:
            return False
        update(x, P, y, S, HP, gain, a[3:6], max(seen, a[20]), len(x) - 1)
    return True


@compiled
def spread(P: Floats, u: Floats, bias: float) -> tuple[float, float]:
    """Standard deviations of the fulcrum across the shaft and along it, in m.

    Args:
        P: Covariance (n, n).
        u: Shaft's direction (3).
        bias: What the sensor's slow bias adds, in m.
    """
    n = len(P)
    along = trace = 0.0
    for i in range(3):
        for j in range(3):
            c = bias**2 if i == j else 0.0
            for k in range(0, n - 2, 6):
                row = i if k == 0 else k - 3 + i
                for m in range(0, n - 2, 6):
                    c += P[row, j if m == 0 else m - 3 + j]
            along += u[i] * u[j] * c
            if i == j:
                trace += c
    return sqrt(max(0.5 * (trace - along), 0.0)), sqrt(max(along, 0.0))


@lru_cache(maxsize=4)
def call_all(n: int) -> None:
    """Calls every kernel once, for a rehearsal.

    Args:
        n: Number of states.
    """
    parts, record = np.zeros((n - 5) // 6), np.ones((2, 13))
    noise, sample = np.ones(5), sample_of(record[0], 1)
    x, P = np.zeros(n), np.eye(n)
    filter_record(x, P, record, 0.1, 1, 1.0, parts, noise, 1.0)
    add_to_record(np.zeros(13), x, sample, np.zeros(3))
    sample[3:6] = 0.0, 0.0, -1.0
    y, _, S, HP, gain, _, _, seen = innovate(x, P, sample, noise, 1.0)
    update(x, P, y, S, HP, gain, sample[3:6], seen, n)
    predict(x, P, 0.1, 1.0, parts, False)
    spread(P, sample[3:6], 0.0)
