"""The Kalman filter behind the fulcrum estimator: prediction and updates.

State x, n = 5 + 6 H: mean position c (3, random walk), per harmonic k of the
breathing a cosine and a sine part a_k, b_k (3 each), ln omega, ln K. The fulcrum
is I = c + sum_k a_k, its velocity -sum_k k omega b_k, and a look ahead by T turns
every (a_k, b_k) by k omega T. The measurement is `wall_model`'s, linearised.
"""

from dataclasses import dataclass, field
from math import cos, exp, log, pi, sin, sqrt

import numpy as np
from scipy.linalg.lapack import dposv

from systems.passive_wrist.wall_model import (
    Vector,
    dot,
    lateral_basis,
    lateral_jacobian,
)


@dataclass
class FulcrumParams:
    """What the estimator assumes.

    Attributes:
        guess: First guess of the fulcrum p_WI, in m.
        guess_sigma: Its standard deviation along the shaft, in m. Sideways the
            first sample says more than any guess.
        stiffness: First guess of the wall's stiffness K, in N/m: from above,
            since the emulation is stable for K up to several times the guess.
        stiffness_sigma: Standard deviation of ln K at the start.
        damping: Of the wall, in N s/m.
        force_noise: Of the sensor, standard deviation per axis, in N.
        moment_noise: In N m.
        force_bias: Standard deviation of the slow bias, in N.
        moment_bias: In N m.
        pose_noise: Of the shaft's pose, in m.
        harmonics: Of the breathing, 1 to 3.
        learn_above: Force above which K is learnt, in N.
        depth_above: Force above which the moment says something of the depth, in N;
            it counts in full from twice that on.
        depth_speed: Speed of the tip across the shaft above which angles say
            something of the depth, in m/s; in full from twice that on.
        length: From the sensor's origin to the tip, in m.
        still_walk: Random walk of the mean once breathing is known, m/sqrt(s).
        wall_walk: The same before that: it has to follow a breathing wall.
        amplitude_walk: Random walk of a harmonic's parts over its own rms, in
            1/sqrt(s).
        axial_ratio: Prior of the unseen axial breathing over the lateral one.
        neighbourhood: The fulcrum is never farther from the guess, in m.
        period: Of the updates, in s.
    """

    guess: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    guess_sigma: float = 0.02
    stiffness: float = 2000.0
    stiffness_sigma: float = 1.0
    damping: float = 5.0
    force_noise: float = 0.05
    moment_noise: float = 0.005
    force_bias: float = 0.02
    moment_bias: float = 0.002
    pose_noise: float = 2e-5
    harmonics: int = 2
    learn_above: float = 0.5
    depth_above: float = 0.25
    depth_speed: float = 4e-3
    length: float = 0.4
    still_walk: float = 1e-4
    wall_walk: float = 5e-3
    amplitude_walk: float = 0.03
    axial_ratio: float = 2.0
    neighbourhood: float = 0.06
    period: float = 1.0 / 120.0

    def check(self) -> None:
        """Raises ValueError naming the first field that makes no sense."""
        for name in [
            "guess_sigma",
            "stiffness_sigma",
            "force_noise",
            "moment_noise",
            "learn_above",
            "depth_above",
            "depth_speed",
            "length",
            "still_walk",
            "wall_walk",
            "amplitude_walk",
            "axial_ratio",
            "neighbourhood",
            "period",
        ]:
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(
                    f"fulcrum estimator: {name}={getattr(self, name)} must be > 0"
                )
        for name in ("damping", "force_bias", "moment_bias", "pose_noise"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise ValueError(
                    f"fulcrum estimator: {name}={getattr(self, name)} must be >= 0"
                )
        if not 10.0 <= self.stiffness <= 2e4:
            raise ValueError(
                f"fulcrum estimator: stiffness={self.stiffness} N/m is no abdominal "
                "wall's; expected 10 to 20000 (100 to 3000 is usual)"
            )
        if len(self.guess) != 3 or not all(abs(g) < 10.0 for g in self.guess):
            raise ValueError(
                f"fulcrum estimator: guess={self.guess} must be 3 numbers in m"
            )
        if self.harmonics not in (1, 2, 3):
            raise ValueError(
                f"fulcrum estimator: harmonics={self.harmonics} must be 1, 2 or 3"
            )


@dataclass
class Sample:
    """One measurement: shaft and wrench, vectors in W, SI units.

    Attributes:
        p_WS: Sensor's origin.
        u: Shaft's unit vector, from the sensor to the tip.
        v_WS: Velocity of the sensor's origin.
        du: Rate of u.
        f: The wall's force on the shaft.
        m: Its moment about the sensor's origin.
        damping: Of the wall; 0 if its part is already taken out of f and m.
        averaged: Number of readings that f and m are the mean of.
        turning: Weight in [0, 1] of what this sample's angle says of the depth.
    """

    p_WS: Vector
    u: Vector
    v_WS: Vector
    du: Vector
    f: Vector
    m: Vector
    damping: float
    averaged: int = 1
    turning: float = 1.0

    def __post_init__(self) -> None:
        """Takes the four lateral components."""
        self.e1, self.e2 = lateral_basis(self.u)
        self.z = (
            dot(self.e1, self.f),
            dot(self.e2, self.f),
            dot(self.e1, self.m),
            dot(self.e2, self.m),
        )


@dataclass
class Innovation:
    """A sample against the state: y = z - h(x), its Jacobian H, S and H P."""

    y: list[float]
    H: np.ndarray
    HP: np.ndarray
    S: np.ndarray
    w: list[float]  # wall against shaft at the contact, in m/s
    solved: np.ndarray  # S^-1 [H P, y]
    u: Vector
    axial: float  # weight in [0, 1] of what the sample says along the shaft

    @property
    def nis(self) -> float:
        """Normalised innovation squared; 4 degrees of freedom."""
        s = self.solved[:, -1].tolist()
        y = self.y
        return y[0] * s[0] + y[1] * s[1] + y[2] * s[2] + y[3] * s[3]


class FulcrumFilter:
    """Prediction and updates of (x, P), in place.

    Attributes:
        n: Number of states.
        total: Matrix (3, n) that adds up the fulcrum, I = total x.
    """

    def __init__(self, params: FulcrumParams) -> None:
        params.check()
        self.p = params
        self.n = 5 + 6 * params.harmonics
        self._identity = np.eye(self.n)
        self.total = np.zeros((3, self.n))
        self.parts = [6 * k + 3 for k in range(params.harmonics)]
        for i in (0, *self.parts):
            self.total[:, i : i + 3] = np.eye(3)
        self._index_turns()

    def _index_turns(self) -> None:
        """Where the turning of each harmonic stands in the transition matrix."""
        n = self.n
        places, turns, partners, slopes = [], [], [], []
        for k, i in enumerate(self.parts):
            for j in (0, 1, 2):
                a, b = i + j, i + 3 + j
                places += [a * (n + 1), b * (n + 1), a * n + b, b * n + a]
                turns += [3 * k, 3 * k, 3 * k + 1, 3 * k + 2]
            partners += [*range(i + 3, i + 6), *range(i, i + 3)]
            slopes += [-(k + 1.0)] * 3 + [k + 1.0] * 3
        self._turned, self._turn = np.array(places), np.array(turns)
        self._partner, self._slope = np.array(partners), np.array(slopes)

    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """State and covariance before the first sample, no breathing."""
        p, n = self.p, self.n
        x, P = np.zeros(n), np.zeros((n, n))
        x[:3] = p.guess
        x[n - 2], x[n - 1] = log(2.0 * pi * 0.25), log(p.stiffness)
        P[:3, :3] = p.guess_sigma**2 * np.eye(3)
        P[n - 1, n - 1] = p.stiffness_sigma**2
        return x, P

    def ahead(self, x: np.ndarray, time: float) -> tuple[list[float], list[float]]:
        """Fulcrum and its velocity `time` s ahead, in m and m/s."""
        xs = x.tolist()
        omega = exp(xs[self.n - 2])
        p, v = xs[0:3], [0.0, 0.0, 0.0]
        for k, i in enumerate(self.parts, 1):
            w = k * omega
            c, s = cos(w * time), sin(w * time)
            for j in (0, 1, 2):
                a, b = xs[i + j], xs[i + 3 + j]
                p[j] += a * c - b * s
                v[j] -= w * (a * s + b * c)
        return p, v

    def noise(self, stiffness: float, depth: float) -> tuple[float, float, float]:
        """Variances of force (N^2) and moment (N^2 m^2) noise, and of force bias."""
        p = self.p
        pose = (stiffness * p.pose_noise) ** 2
        return (
            p.force_noise**2 + pose,
            p.moment_noise**2 + depth**2 * pose,
            p.force_bias**2,
        )

    def turning(self, u: Vector, v_WP: Vector) -> float:
        """Weight of what the shaft's angle says of the depth, from the tip's v."""
        along = dot(u, v_WP)
        return ramp(sqrt(max(dot(v_WP, v_WP) - along**2, 0.0)), self.p.depth_speed)

    def to_first_force(self, x: np.ndarray, P: np.ndarray, a: Sample) -> None:
        """Puts the mean on the line that a force implies; its depth is kept."""
        n = self.n
        stiffness = exp(x[n - 1])
        depth = sum(a.u[i] * (x[i] - a.p_WS[i]) for i in (0, 1, 2))
        offset = np.array(
            [(a.z[0] * a.e1[i] + a.z[1] * a.e2[i]) / stiffness for i in (0, 1, 2)]
        )
        U = np.outer(a.u, a.u)
        noise = self.noise(stiffness, depth)[0] / stiffness**2
        x[:3] = np.asarray(a.p_WS) + depth * np.asarray(a.u) + offset
        # An unknown stiffness leaves the offset along the force unknown with it.
        sigma2 = P[n - 1, n - 1]
        P[:3, :] = 0.0
        P[:, :3] = 0.0
        P[:3, :3] = self.p.guess_sigma**2 * U + noise * (np.eye(3) - U)
        P[:3, :3] += sigma2 * np.outer(offset, offset)
        P[:3, n - 1] = P[n - 1, :3] = -sigma2 * offset

    def predict(
        self,
        x: np.ndarray,
        P: np.ndarray,
        dt: float,
        walk: float,
        part_walks: list[float],
    ) -> None:
        """Moves (x, P) by dt.

        Args:
            x: State, changed in place.
            P: Its covariance, changed in place.
            dt: In s.
            walk: Random walk of the mean, in m/sqrt(s).
            part_walks: The same of each harmonic; empty before breathing is known.
        """
        n = self.n
        diagonal = P.reshape(-1)[:: n + 1]
        if part_walks:
            F = self._identity.copy()
            theta = exp(x[n - 2]) * dt
            turns = []
            for k in range(1, len(part_walks) + 1):
                c, s = cos(k * theta), sin(k * theta)
                turns += [c, -s, s]
            F.reshape(-1)[self._turned] = np.array(turns)[self._turn]
            x[:] = F.dot(x)
            F[3 : n - 2, n - 2] = theta * self._slope * x[self._partner]
            np.dot(F.dot(P), F.T, out=P)
            for i, part in zip(self.parts, part_walks, strict=True):
                diagonal[i : i + 6] += part**2 * dt
            diagonal[n - 2] += 1e-4 * dt
        diagonal[0:3] += walk**2 * dt
        diagonal[n - 1] += 1e-4 * dt

    def innovate(self, x: np.ndarray, P: np.ndarray, a: Sample) -> Innovation:
        """Compares a sample with the state."""
        n = self.n
        xs = x.tolist()
        stiffness, omega = exp(xs[n - 1]), exp(xs[n - 2])
        s, v, du, u = a.p_WS, a.v_WS, a.du, a.u
        r = [xs[0] - s[0], xs[1] - s[1], xs[2] - s[2]]
        w = [-v[0], -v[1], -v[2]]
        for k, i in enumerate(self.parts, 1):
            rate = k * omega
            for j in (0, 1, 2):
                r[j] += xs[i + j]
                w[j] -= rate * xs[i + 3 + j]
        depth = dot(u, r)
        w = [w[0] - depth * du[0], w[1] - depth * du[1], w[2] - depth * du[2]]
        e1, e2 = a.e1, a.e2
        k1, k2 = stiffness * dot(e1, r), stiffness * dot(e2, r)
        f1, f2 = k1 + a.damping * dot(e1, w), k2 + a.damping * dot(e2, w)
        m1, m2 = -depth * f2, depth * f1
        # At forces in the noise the moment's slope by the depth is a guess that
        # multiplies itself and would pull the depth towards the sensor.
        seen = ramp(sqrt(f1 * f1 + f2 * f2), self.p.depth_above)
        M = np.array(
            lateral_jacobian(seen * f1, seen * f2, depth, u, e1, e2, stiffness)
        )
        H = M.dot(self.total)
        H[:, n - 1] = (k1, k2, -depth * k2, depth * k1)
        HP = H.dot(P)
        S = HP.dot(H.T)
        rf, rm, bias = self.noise(stiffness, depth)
        rf = rf / a.averaged + bias
        rm = rm / a.averaged + self.p.moment_bias**2
        S.reshape(-1)[::5] += (rf, rf, rm, rm)
        z = a.z
        y = [z[0] - f1, z[1] - f2, z[2] - m1, z[3] - m2]
        return Innovation(y, H, HP, S, w, solve(S, HP, y), u, max(seen, a.turning))

    def update(self, x: np.ndarray, P: np.ndarray, i: Innovation, held: int) -> None:
        """Kalman update; states from `held` on are considered, not touched.

        Along the shaft the gain is weighed down while the tip stands still. The
        shaft then only turns because it follows the estimate, so that its angle
        repeats the estimate's own errors, and the least error in the process
        noise would drive the depth away. The covariance's update holds for any
        gain (Joseph).
        """
        n = self.n
        gain = i.solved[:, :n].T.copy()
        if held < n:
            gain[held:] = 0.0
        if i.axial < 1.0:
            blocks = gain[: n - 2].reshape(-1, 3, 4)
            u = np.array(i.u)
            along = u.dot(blocks)
            blocks -= ((1.0 - i.axial) * u)[:, None] * along[:, None, :]
        x += gain.dot(i.y)
        # P + K S K^T - K H P - (K H P)^T, so written that rounding grows no skew.
        half = gain.dot(0.5 * i.S.dot(gain.T) - i.HP)
        half += 0.5 * P
        np.add(half, half.T, out=P)

    def jump(self, x: np.ndarray, P: np.ndarray, a: Sample, size: float) -> None:
        """The wall has jumped by about `size` m: fits the mean alone, iterated."""
        P[(0, 1, 2), (0, 1, 2)] += size**2
        prior = x[:3].copy()
        for _ in range(4):
            i = self.innovate(x, P, a)
            # The innovation seen from the prior, linearised at the iterate.
            away = i.H[:, 0:3].dot(x[:3] - prior).tolist()
            i.y = [i.y[j] + away[j] for j in range(4)]
            x[:3] = prior + i.solved[:, :3].T.dot(i.y)
        x[:3] = prior
        i.axial = 1.0
        self.update(x, P, i, 3)


def ramp(value: float, start: float) -> float:
    """0 up to `start`, 1 from twice that on."""
    return min(max(value / start - 1.0, 0.0), 1.0)


def solve(S: np.ndarray, HP: np.ndarray, y: list[float]) -> np.ndarray:
    """S^-1 [H P, y], shape (4, n + 1)."""
    b = np.empty((4, HP.shape[1] + 1))
    b[:, :-1] = HP
    b[:, -1] = y
    _, solved, info = dposv(S, b)
    if info != 0:
        raise ValueError(
            "fulcrum estimator: the innovation's covariance is not positive "
            f"definite (wrench residual {y})"
        )
    return solved
