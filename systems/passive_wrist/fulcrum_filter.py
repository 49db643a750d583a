"""The Kalman filter behind the fulcrum estimator: what it assumes, and its state.

State x, n = 5 + 6 H: mean position c (3, random walk), per harmonic k of the
breathing a cosine and a sine part a_k, b_k (3 each), ln omega, ln K. The fulcrum
is I = c + sum_k a_k, its velocity -sum_k k omega b_k, and a look ahead by T turns
every (a_k, b_k) by k omega T. The measurement is `wall_model`'s, linearised in
`fulcrum_kernels`.
"""

from dataclasses import dataclass
from math import log, pi

import numpy as np

from systems.common.parameter import parameter
from systems.passive_wrist.fulcrum_kernels import LN_K, LN_OMEGA


@dataclass
class FulcrumParams:
    """What the estimator assumes."""

    # Sideways the first sample says more than any guess.
    guess: list[float] = parameter(
        [0.0, 0.0, 0.0], "first one of p_WI", "m", least=-1, most=1, shape=(3,)
    )
    guess_sigma: float = parameter(
        0.02, "standard deviation of the guess along the shaft", "m", above=0, most=0.2
    )
    # From above, since the emulation is stable for K up to several times the guess.
    stiffness: float = parameter(
        2000.0,
        "first guess of the wall's K; 100 to 3000 is usual",
        "N/m",
        least=10,
        most=2e4,
    )
    stiffness_sigma: float = parameter(
        1.0, "standard deviation of ln K at the start", above=0, most=3
    )
    damping: float = parameter(5.0, "of the wall", "N s/m", least=0, most=100)
    force_noise: float = parameter(
        0.05, "of the sensor, standard deviation per axis", "N", above=0, most=5
    )
    moment_noise: float = parameter(
        0.005, "of the sensor, standard deviation per axis", "N m", above=0, most=0.5
    )
    force_bias: float = parameter(
        0.02, "standard deviation of the slow bias", "N", least=0, most=5
    )
    moment_bias: float = parameter(
        0.002, "standard deviation of the slow bias", "N m", least=0, most=0.5
    )
    pose_noise: float = parameter(2e-5, "of the shaft", "m", least=0, most=0.01)
    harmonics: int = parameter(2, "of the breathing", least=1, most=4)
    learn_above: float = parameter(
        0.5, "force above which K is learnt", "N", above=0, most=10
    )
    # Both count in full from twice that on.
    depth_above: float = parameter(
        0.25, "force above which the moment tells of the depth", "N", above=0, most=10
    )
    depth_speed: float = parameter(
        4e-3, "of the tip, above which angles tell of the depth", "m/s", above=0, most=1
    )
    length: float = parameter(
        0.4, "from the sensor's origin to the tip", "m", above=0, most=1
    )
    # Before breathing is known the mean has to follow a wall that breathes.
    still_walk: float = parameter(
        1e-4, "of the mean once breathing is known", "m/sqrt(s)", above=0, most=0.1
    )
    wall_walk: float = parameter(
        5e-3, "of the mean before that", "m/sqrt(s)", above=0, most=1
    )
    amplitude_walk: float = parameter(
        0.03, "of a harmonic's parts over its rms", "1/sqrt(s)", above=0, most=1
    )
    axial_ratio: float = parameter(
        2.0, "prior of the unseen axial breathing to lateral", above=0, most=20
    )
    neighbourhood: float = parameter(
        0.08, "the fulcrum is never farther from the guess", "m", above=0, most=0.3
    )
    steady: bool = parameter(
        False, "whether it is kept from drifting along the shaft, over minutes"
    )
    # The estimate is predicted over it.
    latency: float = parameter(
        0.0, "how old force and pose are when they arrive", "s", least=0, most=0.2
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0, most=0.1)


def prior(params: FulcrumParams) -> tuple[np.ndarray, np.ndarray]:
    """State and covariance before the first sample, no breathing."""
    n = 5 + 6 * params.harmonics
    x, P = np.zeros(n), np.zeros((n, n))
    x[:3] = params.guess
    x[LN_OMEGA], x[LN_K] = log(2.0 * pi * 0.25), log(params.stiffness)
    P[:3, :3] = params.guess_sigma**2 * np.eye(3)
    P[LN_K, LN_K] = params.stiffness_sigma**2
    return x, P
