"""The energy of the snake's free balls and its derivatives, compiled: see `statics`."""

import math
from typing import Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, TURNS, times
from plants.snake.parameters import MODULES, WIRES
from systems.common.compiled import compiled
from systems.common.geometry import Vector, along, norm, over, scaled

ROPES = WIRES * MODULES


class Forces(NamedTuple):
    """What the energy's derivatives are made of: in and out of the kernels.

    Attributes:
        L: Lengths of the wires' paths, (9,).
        T: Their tensions, (9,).
        J: dL/d(delta), (9, 18).
        g: Gradient of the energy, (18,).
        H: Its Hessian, (18, 18).
        P: Mean tension of each wire over each ball, (6, 9).
        slip: How far each wire would give way there, if it did not slide, (6, 9).
        strain: The same of the balls in their sockets, in rad, (6, 3).
    """

    L: Any
    T: Any
    J: Any
    g: Any
    H: Any
    P: Any
    slip: Any
    strain: Any


class Grip(NamedTuple):
    """What friction holds on to (`friction`), fixed while an equilibrium is sought.

    Attributes:
        turns: R_i from which sockets count, (6, 3, 3).
        most: Largest change of a wire's tension over each ball in N, (6, 9).
        slip: To be added to the path beyond each ball's middle, (6, 9) in m.
        socket: Largest torque of each socket in Nm, (6,).
        strain: By which sockets give way at `turns`, (6, 3) in rad.
        step: By which the balls turned in the last step, (18,) in rad: the next may be
            as large, and is looked for from there. Zero without friction.
    """

    turns: Any
    most: Any
    slip: Any
    socket: Any
    strain: Any
    step: Any


@compiled
def empty_forces() -> Forces:
    """Room for them."""
    return Forces(
        np.zeros(ROPES),
        np.zeros(ROPES),
        np.zeros((ROPES, TURNS)),
        np.zeros(TURNS),
        np.zeros((TURNS, TURNS)),
        np.zeros((BALLS, ROPES)),
        np.zeros((BALLS, ROPES)),
        np.zeros((BALLS, 3)),
    )


@compiled
def loose(turns: Any) -> Grip:
    """No friction at all."""
    wires = np.zeros((BALLS, ROPES))
    strain = np.zeros((BALLS, 3))
    sockets, step = np.zeros(BALLS), np.zeros(TURNS)
    return Grip(turns.copy(), wires, wires.copy(), sockets, strain, step)


@compiled
def path_over(p: float, s: Any) -> tuple[float, float, float]:
    """The path f of a chord, and its first two derivatives."""
    if p <= 2 * s.d:
        return p + s.e, 1.0, 0.0
    rho2 = s.R * s.R + s.d * s.d
    q = math.sqrt(max(rho2 - p * p / 4, 1e-12))
    arc = math.asin(min(p / (2 * math.sqrt(rho2)), 1.0)) - math.atan(s.d / s.R)
    return 2 * s.h + 2 * s.R * arc, s.R / q, s.R * p / 4 / q**3


@compiled
def chord(Q: Any, w: int, s: Any) -> float:
    """||P P'|| of wire w across a ball that turns by Q."""
    x, y, d = s.points[w, 0], s.points[w, 1], s.d
    rc = (Q[0, 0] * x + Q[1, 0] * y - Q[2, 0] * d) * x
    rc += (Q[0, 1] * x + Q[1, 1] * y - Q[2, 1] * d) * y
    rc += (Q[0, 2] * x + Q[1, 2] * y - Q[2, 2] * d) * d
    return math.sqrt(max(2 * (s.R * s.R + d * d - rc), 1e-12))


@compiled
def _core(Q: Any, s: Any, g: Any, H: Any) -> float:
    """Energy of one ball's core and rims; adds its derivatives to g and H."""
    # cos(beta) = z . Q z, and the twist's sine and cosine, u = Q_yx - Q_xy and
    # v = Q_xx + Q_yy: their gradients, and their Hessians.
    gc = (-Q[2, 1], Q[2, 0], 0.0)
    beta = math.atan2(math.hypot(Q[0, 2], Q[1, 2]), Q[2, 2])
    past = max(0.0, beta - s.stop)
    energy = 0.5 * s.bend * beta * beta + 0.5 * s.rim * past * past
    torque = s.bend * beta + s.rim * past
    stiff = s.bend + (s.rim if past > 0.0 else 0.0)
    sine = math.sin(beta)
    if beta < 1e-4:
        g1, g2 = -s.bend, s.bend / 3
    else:
        g1 = -torque / sine
        g2 = (stiff * sine - torque * math.cos(beta)) / sine**3
    u, v = Q[1, 0] - Q[0, 1], Q[0, 0] + Q[1, 1]
    n2 = u * u + v * v
    angle = math.atan2(u, v)
    energy += 0.5 * s.twist * angle * angle
    # Of a term P . Q c: c x r with r the row of Q that P picks, and sym(r c^T) - r . c.
    gu = (-Q[0, 2], -Q[1, 2], v)
    gv = (Q[1, 2], -Q[0, 2], -u)
    gt = over(along(scaled(v, gu), -u, gv), n2)
    by_u, by_v = s.twist * angle * v / n2, -s.twist * angle * u / n2
    mixed, squared = -2 * u * v / n2**2, (u * u - v * v) / n2**2  # d/d(u, v) of that
    for i in range(3):
        g[i] += g1 * gc[i] + s.twist * angle * gt[i]
        for j in range(3):
            bowed = mixed * (gu[i] * gu[j] - gv[i] * gv[j])
            bowed += squared * (gu[i] * gv[j] + gv[i] * gu[j])
            H[i, j] += g2 * gc[i] * gc[j] + s.twist * (gt[i] * gt[j] + angle * bowed)
        H[i, i] -= g1 * Q[2, 2] + by_u * u + by_v * v
        row = (
            0.5 * (by_u * Q[1, i] + by_v * Q[0, i]),
            0.5 * (by_v * Q[1, i] - by_u * Q[0, i]),
            0.5 * g1 * Q[2, i],
        )
        for k in range(3):
            H[i, k] += row[k]
            H[k, i] += row[k]
    return energy


@compiled
def _loads(turns: Any, load: Any, s: Any, g: Any, H: Any) -> float:
    """Energy of weight and tool force; adds derivatives, also of the moment."""
    A = np.empty((BALLS, 3, 3))
    A[0] = turns[0]
    for i in range(1, BALLS):
        times(A[i - 1], turns[i], A[i])
    # From the tip inwards: forces f beyond each ball, and S = sum (p - o) f^T about
    # its centre. Turns w_i and w_j, j beyond i, change the energy by
    # -w_i . (S_j - tr S_j) w_j; a moment by the symmetric half of its Jacobian.
    F = np.empty(3)
    S, X, XA = np.zeros((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    m = (load[3], load[4], load[5])
    M = ((0.0, -m[2], m[1]), (m[2], 0.0, -m[0]), (-m[1], m[0], 0.0))
    for k in range(3):
        F[k] = load[k] + s.ring * s.g[k]
    arm = s.tool
    for j in range(BALLS - 1, -1, -1):
        for a in range(3):
            for b in range(3):
                half = s.h * s.plate * s.g[b]
                S[a, b] += A[j, a, 2] * ((arm + 2 * s.h) * F[b] + half)
        arm = 0.0
        trace = S[0, 0] + S[1, 1] + S[2, 2]
        turn = (
            S[1, 2] - S[2, 1] + m[0],
            S[2, 0] - S[0, 2] + m[1],
            S[0, 1] - S[1, 0] + m[2],
        )
        for a in range(3):
            g[3 * j + a] -= A[j, 0, a] * turn[0] + A[j, 1, a] * turn[1]
            g[3 * j + a] -= A[j, 2, a] * turn[2]
            for b in range(3):
                X[a, b] = S[a, b] - (trace if a == b else 0.0) - 0.5 * M[a][b]
        times(X, A[j], XA)
        for i in range(j + 1):
            for a in range(3):
                for b in range(3):
                    value = A[i, 0, a] * XA[0, b] + A[i, 1, a] * XA[1, b]
                    value += A[i, 2, a] * XA[2, b]
                    half = 0.5 if i == j else 1.0
                    H[3 * i + a, 3 * j + b] -= half * value
                    H[3 * j + b, 3 * i + a] -= half * value
        for k in range(3):
            F[k] += (s.plate + s.ball) * s.g[k]
    return -(S[0, 0] + S[1, 1] + S[2, 2])


@compiled
def sine_of(B: Any) -> Vector:
    """Axis of a rotation matrix times the sine of its angle."""
    x, y, z = B[2, 1] - B[1, 2], B[0, 2] - B[2, 0], B[1, 0] - B[0, 1]
    return 0.5 * x, 0.5 * y, 0.5 * z


@compiled
def _held(w: int, T: float, paths: Any, s: Any, grip: Grip, to: Forces) -> float:
    """Tensions of a wire over its balls, and the energy that its friction stores."""
    count = 2 * (w // WIRES + 1)
    energy = beyond = 0.0
    for i in range(count - 1, -1, -1):
        to.slip[i, w] = grip.slip[i, w] + beyond + 0.5 * paths[i, w]
        beyond += paths[i, w]
    for i in range(count):
        most, slip = grip.most[i, w], to.slip[i, w]
        size = min(abs(slip), s.give)
        change = math.copysign(most * size / s.give, slip)
        to.P[i, w] = T + 0.5 * change
        T += change
        energy += most * (abs(slip) - size + 0.5 * size * size / s.give)
    return energy


@compiled
def _stiffened(w: int, stiffness: float, s: Any, grip: Grip, to: Forces) -> None:
    """Adds a wire's stiffness to the Hessian's upper half: J^T C J.

    The friction over ball i pulls at half of the path over it, and at all beyond.
    """
    count = 2 * (w // WIRES + 1)
    J = to.J[w]
    for i in range(count):
        held = 0.0
        if abs(to.slip[i, w]) < s.give:
            held = grip.most[i, w] / s.give
        for a in range(3 * i, 3 * i + 3):
            near, far = (
                (stiffness + 0.25 * held) * J[a],
                (stiffness + 0.5 * held) * J[a],
            )
            for b in range(a, 3 * i + 3):
                to.H[a, b] += near * J[b]
            for b in range(3 * i + 3, 3 * count):
                to.H[a, b] += far * J[b]
        stiffness += held


@compiled
def _socket(i: int, Q: Any, s: Any, grip: Grip, to: Forces, g: Any, H: Any) -> float:
    """Energy that a ball's socket stores and takes; adds its derivatives."""
    # B = R_i^T R_i' of the step so far: its sine's vector, whose gradient is G.
    B, G = np.empty((3, 3)), np.empty((3, 3))
    times(grip.turns[i].T, Q, B)
    trace = B[0, 0] + B[1, 1] + B[2, 2]
    sine = sine_of(B)
    for a in range(3):
        to.strain[i, a] = grip.strain[i, a] + sine[a]
        for b in range(3):
            G[a, b] = 0.5 * ((trace if a == b else 0.0) - B[b, a])
    e = (to.strain[i, 0], to.strain[i, 1], to.strain[i, 2])
    size, give = norm(e), s.give / s.R
    stiff = grip.socket[i] / max(size, give)
    slides = 1.0 / (size * size) if size > give else 0.0
    y = np.empty(3)
    for a in range(3):
        y[a] = G[0, a] * e[0] + G[1, a] * e[1] + G[2, a] * e[2]
    for a in range(3):
        g[a] += stiff * y[a]
        for b in range(3):
            square = G[0, a] * G[0, b] + G[1, a] * G[1, b] + G[2, a] * G[2, b]
            H[a, b] += stiff * (square - slides * y[a] * y[b])
    held = min(size, give)
    return grip.socket[i] * (size - held + 0.5 * held * held / give)


@compiled
def sliding_axis(i: int, Q: Any, s: Any, grip: Grip, to: Forces) -> Vector:
    """What a ball's socket exerts, by the largest torque that it can: (3,)."""
    B, y = np.empty((3, 3)), np.empty(3)
    times(grip.turns[i].T, Q, B)
    trace = B[0, 0] + B[1, 1] + B[2, 2]
    e = (to.strain[i, 0], to.strain[i, 1], to.strain[i, 2])
    size = max(norm(e), s.give / s.R)
    for a in range(3):
        y[a] = 0.5 * trace * e[a]
        for k in range(3):
            y[a] -= 0.5 * B[a, k] * e[k]
    return y[0] / size, y[1] / size, y[2] / size


@compiled
def assembled(
    turns: Any,
    pull: Any,
    stiffness: float,
    wound: Any,
    load: Any,
    s: Any,
    grip: Grip,
    to: Forces,
) -> float:
    """Energy of the balls' turns (6, 3, 3), and its derivatives.

    Args:
        turns: R_i.
        pull: Tensions of wires as long as `wound`, in N, (9,).
        stiffness: Of a wire in N/m; 0 for tensions that are `pull`.
        wound: L_d in m, (9,).
        load: Force and moment on the tool in W, (6,).
        s: The snake, as `Statics` packs it.
        grip: What friction holds on to.
        to: Where the derivatives go.

    Returns:
        The energy in J.
    """
    to.L[:] = 0.0
    to.J[:] = 0.0
    to.g[:] = 0.0
    to.H[:] = 0.0
    R, d = s.R, s.d
    rho2 = R * R + d * d
    kept = np.empty((BALLS, ROPES, 7))
    paths = np.empty((BALLS, ROPES))
    for i in range(BALLS):
        Q = turns[i]
        for w in range(WIRES * (i // 2), ROPES):
            x, y = s.points[w, 0], s.points[w, 1]
            r0 = Q[0, 0] * x + Q[1, 0] * y - Q[2, 0] * d
            r1 = Q[0, 1] * x + Q[1, 1] * y - Q[2, 1] * d
            r2 = Q[0, 2] * x + Q[1, 2] * y - Q[2, 2] * d
            rc = r0 * x + r1 * y + r2 * d
            p = math.sqrt(max(2 * (rho2 - rc), 1e-12))
            f, f1, f2 = path_over(p, s)
            to.L[w] += f
            paths[i, w] = f
            to.J[w, 3 * i] = -f1 * (y * r2 - d * r1) / p
            to.J[w, 3 * i + 1] = -f1 * (d * r0 - x * r2) / p
            to.J[w, 3 * i + 2] = -f1 * (x * r1 - y * r0) / p
            k = kept[i, w]
            k[0], k[1], k[2], k[3], k[4], k[5], k[6] = r0, r1, r2, rc, p, f1, f2
    energy = 0.0
    for w in range(ROPES):
        T = pull[w] + stiffness * (to.L[w] - wound[w])
        least = s.pretension if stiffness > 0.0 else 0.0
        taut = not least > T  # what is no number stays none
        if stiffness > 0.0 and not taut:
            energy += least * (T - 0.5 * least) / stiffness
        T = T if taut else least
        to.T[w] = T
        if stiffness > 0.0:
            energy += T * T / (2 * stiffness) if taut else 0.0
        else:
            energy += T * to.L[w]
        count = 6 * (w // WIRES + 1)
        energy += _held(w, T, paths, s, grip, to)
        for a in range(count):
            to.g[a] += to.P[a // 3, w] * to.J[w, a]
        pulls = taut and T > 0.0
        _stiffened(w, stiffness if pulls else 0.0, s, grip, to)
    for a in range(TURNS):
        for b in range(a):
            to.H[a, b] = to.H[b, a]
    for i in range(BALLS):
        H = to.H[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        for w in range(WIRES * (i // 2), ROPES):
            k, T = kept[i, w], to.P[i, w]
            r, rc, p, f1, f2 = k[:3], k[3], k[4], k[5], k[6]
            c = (s.points[w, 0], s.points[w, 1], d)
            # f'' gp gp^T + f' hess p, with gp = J / f'
            bowed, share = T * (f2 - f1 / p) / (f1 * f1), T * f1 / p
            for a in range(3):
                Ja = bowed * to.J[w, 3 * i + a]
                for b in range(3):
                    half = 0.5 * (r[a] * c[b] + r[b] * c[a])
                    H[a, b] += Ja * to.J[w, 3 * i + b] - share * half
                H[a, a] += share * rc
        energy += _core(turns[i], s, to.g[3 * i : 3 * i + 3], H)
        if grip.socket[i] > 0.0:
            energy += _socket(i, turns[i], s, grip, to, to.g[3 * i : 3 * i + 3], H)
    return energy + _loads(turns, load, s, to.g, to.H)
