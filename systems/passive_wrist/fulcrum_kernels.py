"""The fulcrum filter's arithmetic, compiled.

Small matrices at every control step: in numpy three quarters of the time go into
calls. Compiled it is an eighth, and filtering a record of twelve seconds again fits
into a control period. The state's layout stands in `fulcrum_filter`; `c` is always a
record of its `constants`.
"""

from math import cos, exp, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import along, dot, plus, scaled, sub, unit, xyz
from systems.common.signal import Vector, reader, size, writer
from systems.passive_wrist.wall_model import lateral_basis

Floats = np.ndarray
LN_OMEGA, LN_K = -2, -1
"""Places in x of ln omega and of ln K."""
_STILL = (0.0, 0.0, 0.0)


class Sample(NamedTuple):
    """One measurement: shaft and wrench, vectors in W, SI units.

    Attributes:
        p: p_WS of the sensor's origin.
        u: Shaft's unit vector, from the sensor to the tip.
        v: Velocity of the sensor's origin.
        du: Rate of u.
        f: The wall's force on the shaft.
        m: Its moment about the sensor's origin.
        damping: Of the wall; 0 if its part is already taken out of f and m.
        averaged: Number of readings that f and m are the mean of.
        turning: Weight in [0, 1] of what this sample's angle says of the depth.
    """

    p: Vector
    u: Vector
    v: Vector
    du: Vector
    f: Vector
    m: Vector
    damping: float
    averaged: float
    turning: float


RECORD_PERIOD = 0.1
"""Time between the entries of a record [s]."""


class Entry(NamedTuple):
    """An entry of a record: the means of its samples.

    f and m are lateral, the damping's part taken out.
    """

    p: Vector
    u: Vector
    f: Vector
    m: Vector
    turning: float


read_entry, write_entry = reader(Entry), writer(Entry)
WIDTH = size(Entry)


class Innovation(NamedTuple):
    """A sample against the state.

    Attributes:
        y: z - h(x), shape (4,).
        H: Its Jacobian, shape (4, n).
        S: Its covariance, shape (4, 4).
        HP: H P, shape (4, n).
        gain: The Kalman gain, shape (n, 4).
        w: Wall against shaft at the contact, in m/s.
        nis: Normalised innovation squared, of 4 degrees of freedom; negative if S is
            not positive definite.
        seen: How much the moment says of the depth, in [0, 1].
    """

    y: Floats
    H: Floats
    S: Floats
    HP: Floats
    gain: Floats
    w: Vector
    nis: float
    seen: float


@compiled
def predict(
    x: Floats, P: Floats, dt: float, walk: float, parts: Floats, breathing: bool
) -> None:
    """Moves (x, P) by dt, in place.

    Args:
        x: State (n).
        P: Covariance (n, n).
        dt: In s.
        walk: Random walk of the mean, in m/sqrt(s).
        parts: The same of each harmonic.
        breathing: Whether the harmonics turn.
    """
    n = len(x)
    if breathing:
        theta = exp(x[LN_OMEGA]) * dt
        F = np.eye(n)
        for k in range(len(parts)):
            c, s = cos((k + 1) * theta), sin((k + 1) * theta)
            for i in range(3 + 6 * k, 6 + 6 * k):
                a, b = x[i], x[i + 3]
                F[i, i] = F[i + 3, i + 3] = c
                F[i, i + 3], F[i + 3, i] = -s, s
                x[i], x[i + 3] = a * c - b * s, a * s + b * c
                F[i, LN_OMEGA] = -(k + 1) * theta * x[i + 3]
                F[i + 3, LN_OMEGA] = (k + 1) * theta * x[i]
        P[:] = F @ P @ F.T
        for k in range(len(parts)):
            for i in range(3 + 6 * k, 9 + 6 * k):
                P[i, i] += parts[k] ** 2 * dt
        P[LN_OMEGA, LN_OMEGA] += 3e-5 * dt
    for i in range(3):
        P[i, i] += walk**2 * dt
    P[LN_K, LN_K] += 1e-4 * dt


@compiled
def lateral_slope(
    f1: float, f2: float, depth: float, u: Vector, e1: Vector, e2: Vector, k: float
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
def innovate(c: Any, x: Floats, P: Floats, a: Sample) -> Innovation:
    """Compares a sample with the state."""
    n = len(x)
    K, omega = exp(x[LN_K]), exp(x[LN_OMEGA])
    e1, e2 = lateral_basis(a.u)
    r, w = sub(xyz(x, 0), a.p), sub(_STILL, a.v)
    for k in range((n - 5) // 6):
        r = plus(r, xyz(x, 3 + 6 * k))
        w = along(w, -(k + 1) * omega, xyz(x, 6 + 6 * k))
    depth = dot(a.u, r)
    w = along(w, -depth, a.du)
    k1, k2 = K * dot(e1, r), K * dot(e2, r)
    f1, f2 = k1 + a.damping * dot(e1, w), k2 + a.damping * dot(e2, w)
    # At forces in the noise the moment's slope by the depth is a guess that
    # multiplies itself and would pull the depth towards the sensor.
    seen = min(max(sqrt(f1 * f1 + f2 * f2) / c.depth_above - 1.0, 0.0), 1.0)
    J = lateral_slope(seen * f1, seen * f2, depth, a.u, e1, e2, K)
    H = np.zeros((4, n))
    H[:, 0:3] = J
    for i in range(3, n - 2, 6):
        H[:, i : i + 3] = J
    H[:, LN_K] = k1, k2, -depth * k2, depth * k1
    HP = H @ P
    S = HP @ H.T
    pose = (K * c.pose_noise) ** 2
    rf = (c.force_noise**2 + pose) / a.averaged + c.force_bias**2
    rm = (c.moment_noise**2 + depth**2 * pose) / a.averaged + c.moment_bias**2
    for i in range(2):
        S[i, i] += rf
        S[i + 2, i + 2] += rm
    b = np.empty((4, n + 1))
    b[:, :n] = HP
    b[:, n] = (
        dot(e1, a.f) - f1,
        dot(e2, a.f) - f2,
        dot(e1, a.m) + depth * f2,
        dot(e2, a.m) - depth * f1,
    )
    y = b[:, n].copy()
    sound = _solve(S.copy(), b)
    nis = y[0] * b[0, n] + y[1] * b[1, n] + y[2] * b[2, n] + y[3] * b[3, n]
    gain = b[:, :n].T.copy()
    return Innovation(y, H, S, HP, gain, w, nis if sound else -1.0, seen)


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
    x: Floats, P: Floats, i: Innovation, u: Vector, axial: float, held: int
) -> None:
    """Kalman update in place; states from `held` on are considered, not touched.

    Along the shaft u the gain is weighed down to `axial` in [0, 1], while the tip
    stands still. The shaft then only turns because it follows the estimate, so that
    its angle repeats the estimate's own errors, and the least error in the process
    noise would drive the depth away. The covariance's update holds for any gain
    (Joseph).
    """
    n, gain = len(x), i.gain
    gain[held:] = 0.0
    if axial < 1.0:
        for row in range(0, n - 2, 3):
            for j in range(4):
                lengthwise = (1.0 - axial) * dot(u, xyz(gain[:, j], row))
                for k in range(3):
                    gain[row + k, j] -= lengthwise * u[k]
    x += gain @ i.y
    # P + K S K^T - K H P - (K H P)^T, so written that rounding grows no skew.
    half = gain @ (0.5 * (i.S @ gain.T) - i.HP)
    for row in range(n):
        for j in range(row + 1):
            value = 0.5 * (P[row, j] + P[j, row]) + half[row, j] + half[j, row]
            P[row, j] = P[j, row] = value


@compiled
def entry_of(x: Floats, a: Sample, turning: float, w: Vector) -> Entry:
    """A sample as an entry, the damping's part of its wrench taken out.

    Args:
        x: State.
        a: The sample.
        turning: Weight of its angle.
        w: Wall against shaft at the contact, in m/s.
    """
    e1, e2 = lateral_basis(a.u)
    d1, d2 = dot(scaled(a.damping, e1), w), dot(scaled(a.damping, e2), w)
    depth = dot(a.u, sub(xyz(x, 0), a.p))
    f = along(scaled(dot(e1, a.f) - d1, e1), dot(e2, a.f) - d2, e2)
    m1, m2 = dot(e1, a.m) + depth * d2, dot(e2, a.m) - depth * d1
    return Entry(a.p, a.u, f, along(scaled(m1, e1), m2, e2), turning)


@compiled
def sample_of(entry: Entry, averaged: float) -> Sample:
    """A record's entry as a sample."""
    u = unit(entry.u)
    f, m, turning = entry.f, entry.m, entry.turning
    return Sample(entry.p, u, _STILL, _STILL, f, m, 0.0, averaged, turning)


@compiled
def filter_record(
    packed: Floats, x: Floats, P: Floats, record: Floats, walk: float, parts: Floats
) -> bool:
    """Filters the entries of a record but the first, in place.

    Args:
        packed: Constants.
        x: State at the first entry.
        P: Its covariance.
        record: Entries (m x 13), `RECORD_PERIOD` apart.
        walk: Random walk of the mean, in m/sqrt(s).
        parts: The same of each harmonic.

    Returns:
        False if a covariance went wrong.
    """
    c = packed[0]
    for k in range(1, len(record)):
        predict(x, P, RECORD_PERIOD, walk, parts, True)
        a = sample_of(read_entry(record[k]), c.every)
        i = innovate(c, x, P, a)
        if i.nis < 0.0:
            return False
        update(x, P, i, a.u, max(i.seen, a.turning), len(x) - 1)
    return True


@compiled
def covariance(P: Floats, bias: float) -> Floats:
    """Covariance of the fulcrum, shape (3, 3), in m^2.

    Args:
        P: Covariance (n, n) of the state.
        bias: What the sensor's slow bias adds, in m: it shifts the estimate sideways
            however long one averages.
    """
    n = len(P)
    C = bias**2 * np.eye(3)
    for i in range(3):
        for j in range(3):
            for k in range(0, n - 2, 6):
                row = i if k == 0 else k - 3 + i
                for m in range(0, n - 2, 6):
                    C[i, j] += P[row, j if m == 0 else m - 3 + j]
    return C


@compiled
def spread(P: Floats, u: Vector, bias: float) -> tuple[float, float]:
    """Standard deviations of the fulcrum across the shaft and along it, in m.

    Args:
        P: Covariance (n, n) of the state.
        u: Shaft's direction.
        bias: What the sensor's slow bias adds, in m.
    """
    C = covariance(P, bias)
    lengthwise = trace = 0.0
    for i in range(3):
        trace += C[i, i]
        for j in range(3):
            lengthwise += u[i] * u[j] * C[i, j]
    across = sqrt(max(0.5 * (trace - lengthwise), 0.0))
    return across, sqrt(max(lengthwise, 0.0))
