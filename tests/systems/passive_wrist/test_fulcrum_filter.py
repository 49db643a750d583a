"""The Kalman filter against its textbook form."""

from math import exp, sqrt

import numpy as np
import pytest

from systems.passive_wrist.fulcrum_filter import FulcrumParams, prior
from systems.passive_wrist.fulcrum_kernels import (
    LN_K,
    LN_OMEGA,
    Sample,
    innovate,
    predict,
    update,
)
from systems.passive_wrist.fulcrum_step import constants

PARAMS = FulcrumParams()
C = constants(PARAMS)[0]
STILL = (0.0, 0.0, 0.0)
U = (0.1, 0.0, -sqrt(0.99))


def sample(f=(0.6, 0.2, 0.0), m=(0.02, 0.13, 0.0), turning=1.0) -> Sample:
    return Sample((0.0, 0.0, 0.22), U, STILL, STILL, f, m, 0.0, 1.0, turning)


def state(seed: int = 0):
    rng = np.random.default_rng(seed)
    x, _ = prior(PARAMS)
    n = len(x)
    x[:LN_OMEGA] += 1e-3 * rng.normal(size=n - 2)
    A = 2e-3 * rng.normal(size=(n, n))
    return x, A @ A.T + 1e-8 * np.eye(n)


def fulcrum(x):
    """I = c + a_1 + a_2."""
    return x[0:3] + x[3:6] + x[9:12]


def test_update_is_the_kalman_filter():
    x, P = state()
    i = innovate(C, x, P, sample())
    gain = P @ i.H.T @ np.linalg.inv(i.S)
    expected_x, expected_P = x + gain @ i.y, (np.eye(len(x)) - gain @ i.H) @ P
    update(x, P, i, U, 1.0, len(x))
    np.testing.assert_allclose(x, expected_x, atol=1e-12)
    np.testing.assert_allclose(P, expected_P, atol=1e-12)
    np.testing.assert_array_equal(P, P.T)


def test_considered_states_are_not_touched():
    x, P = state()
    before_x, before_P = x.copy(), P.copy()
    update(x, P, innovate(C, x, P, sample()), U, 1.0, len(x) - 1)
    assert x[LN_K] == before_x[LN_K]
    assert P[LN_K, LN_K] == pytest.approx(before_P[LN_K, LN_K])
    assert not np.allclose(P[:3, LN_K], before_P[:3, LN_K])  # but still correlated
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_a_standing_tip_says_nothing_of_the_depth():
    x, P = state()
    quiet = sample(f=(0.02, 0.0, 0.0), m=STILL, turning=0.0)
    before = x.copy()
    update(x, P, innovate(C, x, P, quiet), U, 0.0, len(x))
    assert np.linalg.norm(x[:3] - before[:3]) > 1e-6
    assert (x[:3] - before[:3]) @ U == pytest.approx(0.0, abs=1e-15)


def test_prediction_turns_the_harmonics():
    x, P = state()
    omega, time = exp(x[LN_OMEGA]), 0.3
    ahead = x[0:3].copy()
    for k in (1, 2):
        a, b = x[6 * k - 3 : 6 * k], x[6 * k : 6 * k + 3]
        ahead += a * np.cos(k * omega * time) - b * np.sin(k * omega * time)
    moved = x.copy()
    predict(moved, P.copy(), time, 0.0, np.zeros(2), True)
    np.testing.assert_allclose(fulcrum(moved), ahead, atol=1e-15)
    # The velocity, -sum k omega b_k, is what moves it on.
    later = moved.copy()
    predict(later, P.copy(), 1e-4, 0.0, np.zeros(2), True)
    v = -omega * (moved[6:9] + 2.0 * moved[12:15])
    moves = (fulcrum(later) - fulcrum(moved)) / 1e-4
    np.testing.assert_allclose(moves, v, rtol=1e-3, atol=1e-7)


def test_transition_matrix_is_the_slope():
    x, _ = state()
    n, size = len(x), 1e-6
    F = np.empty((n, n))
    for j in range(n):
        ends = []
        for sign in (-1.0, 1.0):
            y = x.copy()
            y[j] += sign * size
            predict(y, np.zeros((n, n)), 0.1, 0.0, np.zeros(2), True)
            ends.append(y)
        F[:, j] = (ends[1] - ends[0]) / (2.0 * size)
    P = np.eye(n)
    predict(x.copy(), P, 0.1, 0.0, np.zeros(2), True)
    np.testing.assert_allclose(P, F @ F.T, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stiffness": -5.0}, "fulcrum_estimator.stiffness=-5.0 N/m: expected >= 10"),
        (
            {"stiffness": 1e6},
            "stiffness=1000000.0 N/m: .*<= 20000; the default is 2000",
        ),
        ({"force_noise": 0.0}, "force_noise=0.0 N: expected > 0"),
        ({"force_noise": float("nan")}, "force_noise=nan"),
        ({"guess": [0.0, 0.0]}, "guess=.*3 numbers"),
        ({"harmonics": 7}, "harmonics=7: expected >= 1 and <= 4"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ValueError, match=message):
        constants(FulcrumParams(**change))
