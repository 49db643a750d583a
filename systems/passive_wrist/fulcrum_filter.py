"""The Kalman filter behind the fulcrum estimator: prediction and updates.

State x, n = 5 + 6 H: mean position c (3, random walk), per harmonic k of the
breathing a cosine and a sine part a_k, b_k (3 each), ln omega, ln K. The fulcrum
is I = c + sum_k a_k, its velocity -sum_k k omega b_k, and a look ahead by T turns
every (a_k, b_k) by k omega T. The measurement is `wall_model`'s, linearised.
"""

from dataclasses import dataclass, field
from math import cos, exp, log, pi, sin

import numpy as np

from systems.common.compiled import rehearse
from systems.passive_wrist import fulcrum_kernels as kernels
from systems.passive_wrist.fulcrum_step import to_first_force
from systems.passive_wrist.wall_model import Vector


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
        harmonics: Of the breathing, 1 to 4.
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
        latency: How old force and pose are when they arrive, in s; the estimate is
            predicted over it.
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
    neighbourhood: float = 0.08
    latency: float = 0.0
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
        for name in ("damping", "force_bias", "moment_bias", "pose_noise", "latency"):
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
        if self.harmonics not in (1, 2, 3, 4):
            raise ValueError(
                f"fulcrum estimator: harmonics={self.harmonics} must be 1, 2, 3 or 4"
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
        """Packs all for the kernels."""
        self.packed = np.array(
            [
                *self.p_WS,
                *self.u,
                *self.v_WS,
                *self.du,
                *self.f,
                *self.m,
                self.damping,
                self.averaged,
                self.turning,
            ],
            float,
        )


@dataclass
class Innovation:
    """A sample against the state.

    Attributes:
        y: z - h(x), shape (4,).
        H: Its Jacobian, shape (4, n).
        S: Its covariance, shape (4, 4).
        HP: H P, shape (4, n).
        gain: The Kalman gain, shape (n, 4).
        w: Wall against shaft at the contact, in m/s, shape (3,).
        nis: Normalised innovation squared; 4 degrees of freedom.
        axial: Weight in [0, 1] of what the sample says along the shaft.
        u: The shaft's direction, shape (3,).
    """

    y: np.ndarray
    H: np.ndarray
    S: np.ndarray
    HP: np.ndarray
    gain: np.ndarray
    w: np.ndarray
    nis: float
    axial: float
    u: np.ndarray


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
        self.total = np.zeros((3, self.n))
        self.parts = [6 * k + 3 for k in range(params.harmonics)]
        for i in (0, *self.parts):
            self.total[:, i : i + 3] = np.eye(3)
        rehearse(lambda: kernels.call_all(self.n))
        p = params
        self._noise = np.array(
            [p.force_noise, p.moment_noise, p.force_bias, p.moment_bias, p.pose_noise]
        )

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

    def to_first_force(self, x: np.ndarray, P: np.ndarray, a: np.ndarray) -> None:
        """Puts the mean on the line that a force implies; its depth is kept."""
        to_first_force(x, P, a, self.p.guess_sigma, self._noise)

    def predict(
        self,
        x: np.ndarray,
        P: np.ndarray,
        dt: float,
        walk: float,
        part_walks: np.ndarray,
        breathing: bool,
    ) -> None:
        """Moves (x, P) by dt.

        Args:
            x: State, changed in place.
            P: Its covariance, changed in place.
            dt: In s.
            walk: Random walk of the mean, in m/sqrt(s).
            part_walks: The same of each harmonic.
            breathing: Whether the harmonics turn.
        """
        kernels.predict(x, P, dt, walk, part_walks, breathing)

    def innovate(self, x: np.ndarray, P: np.ndarray, a: Sample) -> Innovation:
        """Compares a sample with the state.

        Raises:
            ValueError: If the innovation's covariance is not positive definite.
        """
        y, H, S, HP, gain, w, nis, seen = kernels.innovate(
            x, P, a.packed, self._noise, self.p.depth_above
        )
        if nis < 0.0:
            raise ValueError(
                "fulcrum estimator: the innovation's covariance is not positive "
                f"definite (wrench residual {y.tolist()})"
            )
        axial = max(seen, a.turning)
        return Innovation(y, H, S, HP, gain, w, nis, axial, a.packed[3:6])

    def update(self, x: np.ndarray, P: np.ndarray, i: Innovation, held: int) -> None:
        """Kalman update; states from `held` on are considered, not touched.

        Along the shaft the gain is weighed down while the tip stands still. The
        shaft then only turns because it follows the estimate, so that its angle
        repeats the estimate's own errors, and the least error in the process
        noise would drive the depth away. The covariance's update holds for any
        gain (Joseph).
        """
        kernels.update(x, P, i.y, i.S, i.HP, i.gain, i.u, i.axial, held)

    def filter_record(
        self,
        x: np.ndarray,
        P: np.ndarray,
        record: np.ndarray,
        dt: float,
        averaged: int,
        walk: float,
        part_walks: np.ndarray,
    ) -> None:
        """Filters the entries of a record but the first, in place."""
        sound = kernels.filter_record(
            x,
            P,
            record,
            dt,
            averaged,
            walk,
            part_walks,
            self._noise,
            self.p.depth_above,
        )
        if not sound:
            raise ValueError("fulcrum estimator: the record cannot be filtered again")
