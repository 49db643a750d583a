"""Singer's model against matrix exponentials, the correction against matrices."""

import numpy as np
import pytest
from scipy.linalg import expm

from systems.sensing.singer import (
    correct_covariance,
    gains,
    predict_covariance,
)

ALPHA, SIGMA = 4.0, 0.1
NOW = (4e-8, 3e-7, 1e-6, 5e-6, 2e-5, 9e-3)


def full(P):
    pp, pv, pa, vv, va, aa = P
    return np.array([[pp, pv, pa], [pv, vv, va], [pa, va, aa]])


@pytest.mark.parametrize("dt", [0.0, 1e-4, 1 / 60, 0.1, 2.0])
def test_prediction_is_the_exact_discretisation(dt):
    A = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -ALPHA]])
    W = np.zeros((3, 3))
    W[2, 2] = 2 * ALPHA * SIGMA**2
    # Van Loan 1978.
    block = expm(np.block([[-A, W], [np.zeros((3, 3)), A.T]]) * dt)
    Phi = block[3:, 3:].T
    Q = Phi @ block[:3, 3:]
    expected = Phi @ full(NOW) @ Phi.T + Q
    np.testing.assert_allclose(
        full(predict_covariance(NOW, dt, ALPHA, SIGMA)),
        expected,
        rtol=1e-8,
        atol=1e-16,
    )
    np.testing.assert_allclose(gains(dt, ALPHA), Phi[:, 2], rtol=1e-6, atol=1e-15)


def test_correction_is_the_matrix_form():
    P, R = full(NOW), 2e-8
    H = np.array([[1.0, 0.0, 0.0]])
    K = P @ H.T / (P[0, 0] + R)
    corrected, gain = correct_covariance(NOW, R)
    np.testing.assert_allclose(full(corrected), (np.eye(3) - K @ H) @ P, rtol=1e-12)
    np.testing.assert_allclose(gain, K[:, 0])
