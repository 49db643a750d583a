"""The nearest safe velocity, against quadprog and a general solver."""

import numpy as np
import pytest
import quadprog
from scipy.optimize import minimize

from systems.common.projection import greatest_rate, nearest_velocity, onto_limits

U = (0.6, 0.0, -0.8)
SPEED, TURNING = 0.1, 0.06


def drawn(rng, n):
    """Rows, bounds (zero is allowed) and a wanted velocity."""
    rows = rng.normal(size=(n, 3))
    return rows, rng.uniform(-0.05, 0.0, n), tuple(rng.uniform(-0.15, 0.15, 3))


def test_without_limits_it_is_the_quadratic_program():
    rng = np.random.default_rng(1)
    for _ in range(200):
        rows, bounds, wanted = drawn(rng, rng.integers(1, 7))
        v, missed = nearest_velocity(wanted, rows, bounds, U, 1e3, 1e3)
        exact = quadprog.solve_qp(np.eye(3), np.array(wanted), rows.T, bounds)[0]
        assert missed == 0.0
        np.testing.assert_allclose(v, exact, atol=2e-5)


def test_with_limits_it_is_the_convex_program():
    rng = np.random.default_rng(2)
    u = np.array(U)
    for _ in range(40):
        rows, bounds, wanted = drawn(rng, 3)
        v, missed = nearest_velocity(wanted, rows, bounds, U, SPEED, TURNING)
        assert missed == 0.0
        w = np.array(wanted)
        constraints = [
            {"type": "ineq", "fun": lambda x, r=rows, b=bounds: r @ x - b},
            {"type": "ineq", "fun": lambda x: SPEED**2 - x @ x},
            {"type": "ineq", "fun": lambda x: TURNING**2 - x @ x + (x @ u) ** 2},
        ]
        exact = minimize(
            lambda x, w=w: 1e2 * (x - w) @ (x - w),
            np.zeros(3),
            constraints=constraints,
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 300},
        )
        ours = np.linalg.norm(np.array(v) - w)
        assert ours <= np.linalg.norm(exact.x - w) + 2e-5


def test_onto_limits_is_the_nearest_point():
    rng = np.random.default_rng(3)
    u = np.array(U)
    samples = rng.uniform(-SPEED, SPEED, (40000, 3))
    across = samples - np.outer(samples @ u, u)
    inside = (np.linalg.norm(samples, axis=1) <= SPEED) & (
        np.linalg.norm(across, axis=1) <= TURNING
    )
    for _ in range(50):
        wanted = rng.uniform(-0.2, 0.2, 3)
        v = np.array(onto_limits(tuple(wanted), U, SPEED, TURNING))
        assert np.linalg.norm(v) <= SPEED + 1e-12
        assert np.linalg.norm(v - (v @ u) * u) <= TURNING + 1e-12
        best = np.linalg.norm(samples[inside] - wanted, axis=1).min()
        assert np.linalg.norm(v - wanted) <= best + 1e-9


def test_greatest_rate_is_reached_and_not_exceeded():
    rng = np.random.default_rng(4)
    for _ in range(50):
        row = rng.normal(size=3)
        far = tuple(100.0 * row)
        v = np.array(onto_limits(far, U, SPEED, TURNING))
        rate = greatest_rate(tuple(row), U, SPEED, TURNING)
        assert row @ v <= rate + 1e-9
        assert row @ v > 0.999 * rate


def test_what_cannot_be_kept_is_told_and_the_speeds_are():
    rows = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    bounds = np.array([0.02, 0.02])
    v, missed = nearest_velocity((0.0, 0.05, 0.0), rows, bounds, U, SPEED, TURNING)
    assert missed == pytest.approx(0.02, abs=1e-3)  # each as much as the other
    assert np.linalg.norm(v) <= SPEED + 1e-9
