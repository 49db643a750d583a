"""Statics of the snake as it is: six balls that turn freely, wires, core and load.

The paper lets both balls of a module turn alike and without torsion, and says of the
latter that "a gap can remain according to the robot configuration and must be
considered in a static model". Here ball i turns by any R_i; equations (2) and (3)
hold as they are, since they depend on the chord p = ||P P'|| across a ball alone:

    p^2 = 2 (rho^2 - P . R_i c),   P = R (cos, sin) - d z,   c = R (cos, sin) + d z
    f(p) = p + e  or  2h + 2R [asin(p / 2 rho) - atan(d / R)],   L_w = sum f

With R_i exp(delta) and r = R_i^T P, P . R_i c has the gradient c x r and the Hessian
sym(r c^T) - (r . c) I. The energy of wires, core, weight and tool force is

    E = sum T^2 / 2k  or  sum T L,  T = max(0, pull + k (L - L_d)),  + ...

Where it is least the snake stays; an eigenvalue of its Hessian that is not positive
says that it does not, though it be in balance.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import MODULES, STOP, WIRES, SnakeParams
from plants.snake.posture import Array, bends_of, whole_postures
from plants.snake.weight import GRAVITY
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, norm, over, scaled
from systems.common.parameter import check

BALLS = 2 * MODULES
TURNS = 3 * BALLS
"""Freedoms: three of each ball."""
ROPES = WIRES * MODULES

TOLERANCE = 1e-10
"""Of the torques that are left in an equilibrium, in Nm."""
LONGEST = 0.3
"""Step of a ball in an iteration, in rad."""
MOST = 60
"""Iterations."""
RIGID = 1e3
"""Torsion of coupled balls, in Nm/rad: as good as none."""
RIM = 5.0
"""Of plates that meet at their rims, in Nm/rad."""


class Forces(NamedTuple):
    """What the energy's derivatives are made of: in and out of the kernels.

    Attributes:
        L: Lengths of the wires' paths, (9,).
        T: Their tensions, (9,).
        J: dL/d(delta), (9, 18).
        g: Gradient of the energy, (18,).
        H: Its Hessian, (18, 18).
    """

    L: Any
    T: Any
    J: Any
    g: Any
    H: Any


@compiled
def empty_forces() -> Forces:
    """Room for them."""
    return Forces(
        np.zeros(ROPES),
        np.zeros(ROPES),
        np.zeros((ROPES, TURNS)),
        np.zeros(TURNS),
        np.zeros((TURNS, TURNS)),
    )


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
    # Of a term P . Q c: c x r with r the row of Q that P picks.
    gu = (-Q[0, 2], -Q[1, 2], v)
    gv = (Q[1, 2], -Q[0, 2], -u)
    gt = over(along(scaled(v, gu), -u, gv), n2)
    for i in range(3):
        g[i] += g1 * gc[i] + s.twist * angle * gt[i]
        for j in range(3):
            hc = 0.5 * (Q[2, i] * (j == 2) + Q[2, j] * (i == 2)) - Q[2, 2] * (i == j)
            hu = 0.5 * (Q[1, i] * (j == 0) + Q[1, j] * (i == 0)) - Q[1, 0] * (i == j)
            hu -= 0.5 * (Q[0, i] * (j == 1) + Q[0, j] * (i == 1)) - Q[0, 1] * (i == j)
            hv = 0.5 * (Q[0, i] * (j == 0) + Q[0, j] * (i == 0)) - Q[0, 0] * (i == j)
            hv += 0.5 * (Q[1, i] * (j == 1) + Q[1, j] * (i == 1)) - Q[1, 1] * (i == j)
            ht = (v * hu - u * hv) / n2
            # d/d(u, v) of (v, -u)/n2
            ht -= 2 * u * v / n2**2 * (gu[i] * gu[j] - gv[i] * gv[j])
            ht -= (v * v - u * u) / n2**2 * (gu[i] * gv[j] + gv[i] * gu[j])
            H[i, j] += g2 * gc[i] * gc[j] + g1 * hc
            H[i, j] += s.twist * (gt[i] * gt[j] + angle * ht)
    return energy


@compiled
def _times(A: Any, B: Any, out: Any) -> None:
    """A B of 3 x 3 matrices; `@` costs a call of BLAS and a new array."""
    for a in range(3):
        for b in range(3):
            out[a, b] = A[a, 0] * B[0, b] + A[a, 1] * B[1, b] + A[a, 2] * B[2, b]


@compiled
def _loads(turns: Any, load: Any, s: Any, g: Any, H: Any) -> float:
    """Energy of weight and tool force; adds derivatives, also of the moment."""
    A = np.empty((BALLS, 3, 3))
    A[0] = turns[0]
    for i in range(1, BALLS):
        _times(A[i - 1], turns[i], A[i])
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
        _times(X, A[j], XA)
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
def assembled(
    turns: Any, pull: Any, stiffness: float, wound: Any, load: Any, s: Any, to: Forces
) -> float:
    """Energy of the balls' turns (6, 3, 3), and its derivatives.

    Args:
        turns: R_i.
        pull: Tensions of wires as long as `wound`, in N, (9,).
        stiffness: Of a wire in N/m; 0 for tensions that are `pull`.
        wound: L_d in m, (9,).
        load: Force and moment on the tool in W, (6,).
        s: The snake, as `Statics` packs it.
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
            to.J[w, 3 * i] = -f1 * (y * r2 - d * r1) / p
            to.J[w, 3 * i + 1] = -f1 * (d * r0 - x * r2) / p
            to.J[w, 3 * i + 2] = -f1 * (x * r1 - y * r0) / p
            k = kept[i, w]
            k[0], k[1], k[2], k[3], k[4], k[5], k[6] = r0, r1, r2, rc, p, f1, f2
    energy = 0.0
    for w in range(ROPES):
        T = pull[w] + stiffness * (to.L[w] - wound[w])
        if T < 0.0:  # slack; what is no number stays none
            T = 0.0
        to.T[w] = T
        energy += T * T / (2 * stiffness) if stiffness > 0.0 else T * to.L[w]
        count = 6 * (w // WIRES + 1)
        for a in range(count):
            to.g[a] += T * to.J[w, a]
        if T > 0.0 and stiffness > 0.0:
            for a in range(count):
                ka = stiffness * to.J[w, a]
                for b in range(count):
                    to.H[a, b] += ka * to.J[w, b]
    for i in range(BALLS):
        H = to.H[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        for w in range(WIRES * (i // 2), ROPES):
            k, T = kept[i, w], to.T[w]
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
    return energy + _loads(turns, load, s, to.g, to.H)


@compiled
def turned_by(turns: Any, delta: Any, out: Any) -> None:
    """R_i exp(delta_i) of each ball."""
    E = np.empty((3, 3))
    for i in range(BALLS):
        d = (delta[3 * i], delta[3 * i + 1], delta[3 * i + 2])
        angle = norm(d)
        small = angle < 1e-8
        a = 1.0 if small else math.sin(angle) / angle
        b = 0.5 if small else (1 - math.cos(angle)) / angle**2
        for k in range(3):
            for n in range(3):
                E[k, n] = b * d[k] * d[n]
            E[k, k] += math.cos(angle)
        for k in range(3):
            E[k, (k + 1) % 3] -= a * d[(k + 2) % 3]
            E[(k + 1) % 3, k] += a * d[(k + 2) % 3]
        _times(turns[i], E, out[i])


@compiled
def _reduced(to: Forces, s: Any, g: Any, H: Any) -> None:
    """Gradient and Hessian of the freedoms there are: coupled balls turn alike."""
    if not s.coupled:
        g[:], H[:] = to.g, to.H
        return
    for i in range(3 * MODULES):
        a = 6 * (i // 3) + i % 3
        g[i] = (to.g[a] + to.g[a + 3]) / math.sqrt(2.0)
        for j in range(3 * MODULES):
            b = 6 * (j // 3) + j % 3
            H[i, j] = to.H[a, b] + to.H[a + 3, b] + to.H[a, b + 3] + to.H[a + 3, b + 3]
            H[i, j] *= 0.5


@compiled
def _expanded(step: Any, s: Any, delta: Any) -> None:
    if not s.coupled:
        delta[:] = step
        return
    for i in range(3 * MODULES):
        a = 6 * (i // 3) + i % 3
        delta[a] = delta[a + 3] = step[i] / math.sqrt(2.0)


@compiled
def _factored(H: Any, shift: float, U: Any) -> bool:
    """Lower Cholesky factor of H + shift I, and whether there is one."""
    n = len(H)
    for j in range(n):
        for i in range(j, n):
            total = H[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                total -= U[i, k] * U[j, k]
            if i == j:
                if not total > 1e-9:
                    return False
                U[j, j] = math.sqrt(total)
            else:
                U[i, j] = total / U[j, j]
    return True


@compiled
def _descent(g: Any, H: Any, U: Any, step: Any) -> bool:
    """A Newton step; whether the Hessian had to be lifted to be positive."""
    shift = 0.0
    while not _factored(H, shift, U):
        shift = max(2e-3, 3 * shift)
        if not shift < 1e9:  # it has no finite value
            step[:] = 0.0
            return True
    n = len(g)
    for i in range(n):
        total = -g[i]
        for k in range(i):
            total -= U[i, k] * step[k]
        step[i] = total / U[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= U[k, i] * step[k]
        step[i] = total / U[i, i]
    return shift > 0.0


@compiled
def settled(
    start: Any, pull: Any, stiffness: float, wound: Any, load: Any, s: Any, most: int
) -> tuple[Any, Forces, float, int, bool, bool]:
    """The equilibrium that is downhill from a start: Newton's method with a search.

    Returns:
        Turns, forces there, the least eigenvalue, iterations, whether the torques
        that are left are below `TOLERANCE`, and whether the way led over a Hessian
        that is not positive.
    """
    n = 3 * MODULES if s.coupled else TURNS
    now, new = start.copy(), start.copy()
    here, there = empty_forces(), empty_forces()
    g, H, U, step = np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    delta = np.zeros(TURNS)
    energy = assembled(now, pull, stiffness, wound, load, s, here)
    has_moment = load[3] != 0.0 or load[4] != 0.0 or load[5] != 0.0
    done = left_it = False
    count = 0
    for count in range(most + 1):
        _reduced(here, s, g, H)
        left = np.abs(g).max()
        done = left < TOLERANCE
        if done or count == most or not math.isfinite(left):
            break
        left_it = _descent(g, H, U, step) or left_it
        size = np.abs(step).max()
        share = 1.0 if size <= LONGEST else LONGEST / size
        slope = 0.0
        for a in range(n):
            slope += g[a] * step[a]
        better = False
        for _ in range(25):
            _expanded(step * share, s, delta)
            turned_by(now, delta, new)
            e = assembled(new, pull, stiffness, wound, load, s, there)
            # Below rounding, and of a moment, the energy tells nothing; torques do.
            if has_moment or abs(e - energy) < 1e-13 * (1e-3 + abs(energy)):
                _reduced(there, s, g, H)
                better = np.abs(g).max() < left
            if not has_moment:
                better = better or e <= energy + 1e-4 * share * slope
            if better:
                break
            share *= 0.4
        if not better:
            break
        now, new = new, now
        here, there = there, here
        energy = e
    _reduced(here, s, g, H)
    least = math.nan
    if math.isfinite(np.abs(H).max()):
        least = np.linalg.eigvalsh(H)[0]
    return now, here, least, count, done, left_it


class Equilibrium(NamedTuple):
    """Where the snake stays, if it does.

    Attributes:
        turns: R_i of the six balls, (6, 3, 3).
        L: Lengths of the wires' paths in m, (9,).
        T: Tensions in N, (9,).
        least_eigenvalue: Of the energy's Hessian in Nm/rad: not positive where it is
            in balance and does not stay.
        iterations: That it took.
        converged: Whether it is in balance.
        buckled: Whether the way there left a state that it could not stay in.
    """

    turns: Array
    L: Array
    T: Array
    least_eigenvalue: float
    iterations: int
    converged: bool
    buckled: bool

    @property
    def stable(self) -> bool:
        """Whether the snake stays there."""
        return self.converged and self.least_eigenvalue > 0.0


class Statics:
    """A snake, its drive's masses and stiffness, and its core.

    Attributes:
        record: All of it, as the kernels take it: `record[0]`.
    """

    def __init__(
        self,
        params: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        core: SnakeCoreParams | None = None,
        gravity: ArrayLike = GRAVITY,
    ) -> None:
        """Makes it; `gravity` in W in m/s2, (3,)."""
        self.params = p = check(params or SnakeParams())
        self.drive = v = check(drive or SnakeDriveParams())
        self.core = c = check(core or SnakeCoreParams())
        phi = np.ravel(p.azimuths())
        elastic = c.kind == "elastic"
        self.record = packed(
            R=p.ball_radius,
            d=p.face,
            e=p.plate_thickness,
            h=p.half_pitch,
            tool=p.tool_offset,
            points=p.ball_radius * np.column_stack([np.cos(phi), np.sin(phi)]),
            coupled=c.kind == "coupled",
            bend=c.bend if elastic else 0.0,
            twist=c.twist if elastic else RIGID if c.kind == "coupled" else 0.0,
            stop=p.max_bend + STOP,
            rim=RIM,
            ball=v.ball_mass,
            plate=v.plate_mass,
            ring=v.tool_mass,
            g=np.asarray(gravity, float),
        )

    def energy(
        self,
        turns: Array,
        tension: ArrayLike,
        wound: ArrayLike | None = None,
        force: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
    ) -> tuple[float, Forces]:
        """Energy in J and its derivatives, under tensions or lengths.

        Args:
            turns: R_i, (6, 3, 3).
            tension: Of wires as long as `wound`, or of all that there are, in N, (9,).
            wound: L_d of the drums in m, (9,); None for wires under `tension`.
            force: On the tool in W, in N, (3,).
            moment: On the tool in W, in Nm, (3,); it has no energy.
        """
        to = empty_forces()
        args = self._arguments(tension, wound, force, moment)
        return assembled(turns, *args, self.record[0], to), to

    def equilibrium(
        self,
        turns: Array,
        tension: ArrayLike = (0.0,) * ROPES,
        wound: ArrayLike | None = None,
        force: ArrayLike = (0.0, 0.0, 0.0),
        moment: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Equilibrium:
        """The equilibrium downhill from turns; arguments as of `energy`."""
        args = self._arguments(tension, wound, force, moment)
        now, to, least, count, done, buckled = settled(
            turns, *args, self.record[0], MOST
        )
        return Equilibrium(now, to.L, to.T, least, count, done, buckled)

    def _arguments(
        self, tension: Any, wound: Any, force: Any, moment: Any
    ) -> tuple[Any, float, Any, Any]:
        load = np.array([*force, *moment], float)
        stiffness = 0.0 if wound is None else self.drive.wire_stiffness
        wound = np.zeros(ROPES) if wound is None else np.asarray(wound, float)
        return np.asarray(tension, float), stiffness, wound, load


def turns_of(x: ArrayLike) -> Array:
    """R_i (6, 3, 3) of a posture (7,): alike in a module, and without torsion."""
    q = bends_of(whole_postures(x))
    turns = np.broadcast_to(np.eye(3), (BALLS, 3, 3)).copy()
    alpha, beta = q[1::2], q[2::2]
    axes = np.stack([-beta * np.sin(alpha), beta * np.cos(alpha), 0 * beta], axis=1)
    out = np.empty_like(turns)
    turned_by(turns, np.repeat(axes, 2, axis=0).ravel(), out)
    return out


def gaps(turns: Array) -> tuple[Array, Array]:
    """What the paper takes to be zero, in rad.

    Args:
        turns: R_i, (..., 6, 3, 3).

    Returns:
        Split of each module, between the bends of its two balls, (..., 3), and each
        ball's torsion, (..., 6).
    """
    x, y, z = turns[..., 0, 2], turns[..., 1, 2], turns[..., 2, 2]
    sine = np.hypot(x, y)
    size = np.arctan2(sine, z) / np.where(sine > 0.0, sine, 1.0)
    bend = np.stack([x, y], axis=-1) * size[..., None]
    split = np.linalg.norm(bend[..., 0::2, :] - bend[..., 1::2, :], axis=-1)
    torsion = np.arctan2(
        turns[..., 1, 0] - turns[..., 0, 1], turns[..., 0, 0] + turns[..., 1, 1]
    )
    return split, torsion


def tool_pose(turns: Array, s: float, params: SnakeParams) -> Array:
    """X_WT (4, 4) of balls that turn by R_i (6, 3, 3) at a translation s."""
    X = np.eye(4)
    X[2, 3] = s
    for turn in turns:
        X[:3, :3] = X[:3, :3] @ turn
        X[:3, 3] += 2 * params.half_pitch * X[:3, 2]
    X[:3, 3] += params.tool_offset * X[:3, 2]
    return X


def angles_of(turns: Array) -> Array:
    """Angles of joints Rx, Ry, Rz a ball in rad, (18,), that turn by R_i."""
    a = np.arctan2(-turns[:, 1, 2], turns[:, 2, 2])
    b = np.arcsin(np.clip(turns[:, 0, 2], -1.0, 1.0))
    c = np.arctan2(-turns[:, 0, 1], turns[:, 0, 0])
    return np.stack([a, b, c], axis=1).ravel()


def turns_of_angles(angles: ArrayLike) -> Array:
    """R_i (..., 6, 3, 3) of the joints' angles, (..., 18)."""
    q = np.asarray(angles, float)
    q = q.reshape(*q.shape[:-1], BALLS, 3)
    ca, cb, cc = np.moveaxis(np.cos(q), -1, 0)
    sa, sb, sc = np.moveaxis(np.sin(q), -1, 0)
    rows = [
        [cb * cc, -cb * sc, sb],
        [sa * sb * cc + ca * sc, ca * cc - sa * sb * sc, -sa * cb],
        [sa * sc - ca * sb * cc, ca * sb * sc + sa * cc, ca * cb],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def corners_of(turns: Array, s: ArrayLike, params: SnakeParams) -> Array:
    """Six ball centres, O3 and the tool in W, as `kinematics.centreline`.

    Args:
        turns: R_i, (..., 6, 3, 3).
        s: Translation in m, (...).
        params: The snake.

    Returns:
        Points in m, (..., 8, 3).
    """
    p = np.zeros((*turns.shape[:-3], 3))
    p[..., 2] = s
    axes, points = np.eye(3), [p]
    reach = 2 * params.half_pitch
    for i in range(BALLS):
        axes = axes @ turns[..., i, :, :]
        points.append(points[-1] + reach * axes[..., 2])
    points.append(points[-1] + params.tool_offset * axes[..., 2])
    return np.stack(points, axis=-2)
