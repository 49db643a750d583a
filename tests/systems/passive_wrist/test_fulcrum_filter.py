"""The Kalman filter against its textbook form."""

import numpy as np
import pytest

from systems.passive_wrist.fulcrum_filter import FulcrumFilter, FulcrumParams, Sample

STILL = [0.0, 0.0, 0.0]


def sample(f=(0.6, 0.2, 0.0), m=(0.02, 0.13, 0.0), turning=1.0) -> Sample:
    u = [0.1, 0.0, -np.sqrt(0.99)]
    return Sample([0.0, 0.0, 0.22], u, STILL, STILL, f, m, 0.0, turning=turning)


def state(dut: FulcrumFilter, seed: int = 0):
    rng = np.random.default_rng(seed)
    x, _ = dut.prior()
    x[: dut.n - 2] += 1e-3 * rng.normal(size=dut.n - 2)
    A = 2e-3 * rng.normal(size=(dut.n, dut.n))
    return x, A @ A.T + 1e-8 * np.eye(dut.n)


def test_update_is_the_kalman_filter():
    dut = FulcrumFilter(FulcrumParams())
    x, P = state(dut)
    i = dut.innovate(x, P, sample())
    gain = P @ i.H.T @ np.linalg.inv(i.S)
    expected_x, expected_P = x + gain @ i.y, (np.eye(dut.n) - gain @ i.H) @ P
    dut.update(x, P, i, dut.n)
    np.testing.assert_allclose(x, expected_x, atol=1e-12)
    np.testing.assert_allclose(P, expected_P, atol=1e-12)
    np.testing.assert_array_equal(P, P.T)


def test_considered_states_are_not_touched():
    dut = FulcrumFilter(FulcrumParams())
    x, P = state(dut)
    before_x, before_P = x.copy(), P.copy()
    dut.update(x, P, dut.innovate(x, P, sample()), dut.n - 1)
    assert x[-1] == before_x[-1]
    assert P[-1, -1] == pytest.approx(before_P[-1, -1])
    assert not np.allclose(P[:3, -1], before_P[:3, -1])  # but still correlated
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_a_standing_tip_says_nothing_of_the_depth():
    dut = FulcrumFilter(FulcrumParams())
    x, P = state(dut)
    quiet = sample(f=(0.02, 0.0, 0.0), m=(0.0, 0.0, 0.0), turning=0.0)
    i = dut.innovate(x, P, quiet)
    i.axial = 0.0
    before = x.copy()
    dut.update(x, P, i, dut.n)
    u = np.array(quiet.u)
    assert (x[:3] - before[:3]) @ u == pytest.approx(0.0, abs=1e-15)


def test_prediction_turns_the_harmonics():
    dut = FulcrumFilter(FulcrumParams(harmonics=2))
    x, P = state(dut)
    ahead, v = dut.ahead(x, 0.3)
    later, _ = dut.ahead(x, 0.3001)
    np.testing.assert_allclose(
        (np.array(later) - ahead) / 1e-4, v, rtol=1e-3, atol=1e-7
    )
    moved = x.copy()
    dut.predict(moved, P.copy(), 0.3, 0.0, np.zeros(2), True)
    np.testing.assert_allclose(dut.total @ moved, ahead, atol=1e-15)


def test_transition_matrix_is_the_slope():
    dut = FulcrumFilter(FulcrumParams())
    x, _ = state(dut)
    size = 1e-6
    F = np.empty((dut.n, dut.n))
    for j in range(dut.n):
        ends = []
        for sign in (-1.0, 1.0):
            y = x.copy()
            y[j] += sign * size
            dut.predict(y, np.zeros((dut.n, dut.n)), 0.1, 0.0, np.zeros(2), True)
            ends.append(y)
        F[:, j] = (ends[1] - ends[0]) / (2.0 * size)
    P = np.eye(dut.n)
    dut.predict(x.copy(), P, 0.1, 0.0, np.zeros(2), True)
    np.testing.assert_allclose(P, F @ F.T, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stiffness": -5.0}, "no abdominal"),
        ({"stiffness": 1e6}, "100 to 3000 is usual"),
        ({"force_noise": 0.0}, "force_noise=0.0 must be > 0"),
        ({"force_noise": float("nan")}, "force_noise=nan"),
        ({"guess": [0.0, 0.0]}, "3 numbers"),
        ({"harmonics": 7}, "harmonics=7 must be 1, 2, 3 or 4"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ValueError, match=message):
        FulcrumFilter(FulcrumParams(**change))
