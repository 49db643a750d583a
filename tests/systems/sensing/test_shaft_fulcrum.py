"""The fulcrum from the shaft's lines, and the tip by its help."""

import math

import numpy as np
import pytest

from systems.common.signal import vector
from systems.common.signals import Shaft
from systems.sensing import optical_tracker
from systems.sensing.optical_tracker import MarkerBody, MarkerNoise, disturb
from systems.sensing.shaft_fulcrum import (
    FIRST,
    absorb_line,
    initial_fulcrum,
    lateral_variance,
    measure,
)
from systems.sensing.trajectory_estimator import (
    TrajectoryEstimatorParams,
    constants,
)

BODY = MarkerBody()
MARKERS = optical_tracker.constants(BODY)[0]
G = np.array([0.02, 0.09, 0.004])


def dut(given=None, drift=1e-4, sigma_wall=0.01):
    params = TrajectoryEstimatorParams(
        body=BODY, fulcrum=given, fulcrum_drift=drift, sigma_wall=sigma_wall
    )
    return constants(params)[0]


def frames(tips, seed, fulcrum=G):
    """Measured markers' mean, direction and true tip of each frame."""
    rng = np.random.default_rng(seed)
    for tip in tips:
        u = (tip - fulcrum) / np.linalg.norm(tip - fulcrum)
        noise = MarkerNoise(
            vector(rng.standard_normal(3)), vector(rng.standard_normal(3))
        )
        m = disturb(MARKERS, Shaft(vector(tip), vector(u)), noise)
        c = tuple(p - BODY.lever * d for p, d in zip(m.tip, m.u, strict=True))
        yield c, m.u, tip


def moving(n):
    t = np.arange(n) / 60.0
    return np.c_[0.04 * np.sin(0.7 * t), 0.03 * np.sin(0.4 * t), -0.12 + 0.0 * t]


def track(fulcrum, tips, seed, true=G, state=None):
    if state is None:
        given = fulcrum["fulcrum"].tolist() if fulcrum["given"] else None
        state = initial_fulcrum(given)
    errors, spreads = [], []
    for k, (c, u, tip) in enumerate(frames(tips, seed, true)):
        first = k == 0 and state.reference[2] == -1.0 and not any(state.P)
        dt = FIRST if first else 1 / 60
        state, sight = absorb_line(fulcrum, state, c, u, dt)
        errors.append(np.array(sight.tip) - tip)
        spreads.append(sight.variance + sight.shared)
    return state, np.array(errors), np.array(spreads)


def test_measure_is_the_matrix_form():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(3, 3))
    P = A @ A.T
    h = np.array([2.0, -1.0, 2.0]) / 3.0
    p = np.array([0.1, 0.2, 0.3])
    K = P @ h / (h @ P @ h + 0.5)
    upper = np.triu_indices(3)
    q, Q = measure(tuple(p), tuple(P[upper]), tuple(h), 0.7, 0.5)
    np.testing.assert_allclose(q, p + K * (0.7 - h @ p))
    np.testing.assert_allclose(Q, (P - np.outer(K, h @ P))[upper])
    expected = (np.trace(P) - h @ P @ h) / 2.0
    assert lateral_variance(tuple(P[upper]), tuple(h)) == pytest.approx(expected)


def test_moving_shaft_gives_the_least_squares_intersection():
    tips = moving(900)
    state, _, _ = track(dut(drift=0.0, sigma_wall=1.0), tips, seed=3)
    # The batch solution: sum (1 - u u') G = sum (1 - u u') c.
    lines = list(frames(tips, 3))
    M = [np.eye(3) - np.outer(u, u) for _, u, _ in lines]
    rhs = sum(m @ np.array(c) for m, (c, _, _) in zip(M, lines, strict=True))
    batch = np.linalg.solve(sum(M), rhs)
    np.testing.assert_allclose(state.g, G, atol=2e-4)
    np.testing.assert_allclose(state.g, batch, atol=4e-4)


def test_fulcrum_error_is_as_large_as_stated():
    squares = []
    for seed in range(40):
        state, _, _ = track(dut(), moving(240), seed)
        xx, xy, xz, yy, yz, zz = state.P
        P = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        error = np.array(state.g) - G
        squares.append(error @ np.linalg.solve(P, error))
    # 3 on average; the drift that is allowed for does not happen: a little less.
    assert 1.0 < np.mean(squares) < 3.9


def test_tool_at_rest_does_not_move_its_fulcrum_along_the_shaft():
    tip, fulcrum = np.array([0.0, 0.0, -0.12]), np.array([0.02, 0.09, 0.0])
    u = (tip - fulcrum) / np.linalg.norm(tip - fulcrum)
    along = []
    for seed in range(6):
        state, _, _ = track(dut(), np.tile(tip, (900, 1)), seed, true=fulcrum)
        error = np.array(state.g) - fulcrum
        along.append(error @ u)
        assert np.linalg.norm(error - (error @ u) * u) < 3e-4
        # All that is known along the shaft: the wall's height to 10 mm.
        assert 0.008 < math.sqrt(state.P[5]) < 0.0101
    assert abs(np.mean(along)) < 0.003


def test_tip_is_found_better_through_the_fulcrum():
    tips = moving(1200)
    _, errors, variances = track(dut(), tips, seed=5)
    raw = np.array(
        [np.add(c, BODY.lever * np.array(u)) - tip for c, u, tip in frames(tips, 5)]
    )
    late = slice(300, None)
    rms = np.sqrt((errors[late] ** 2).sum(axis=1).mean())
    assert rms < 0.25 * np.sqrt((raw[late] ** 2).sum(axis=1).mean())
    stated = np.sqrt(3.0 * variances[late].mean())
    assert 0.6 * stated < rms < 1.1 * stated


def test_another_fulcrum_is_noticed():
    fulcrum = dut()
    state, _, _ = track(fulcrum, moving(300), seed=6)
    other = G + np.array([0.015, -0.01, 0.0])
    tips = moving(600)
    state, errors, _ = track(fulcrum, tips, seed=7, true=other, state=state)
    np.testing.assert_allclose(state.g, other, atol=5e-4)
    # Meanwhile the tip is never worse than the tracker itself finds it (4 sigma).
    assert np.abs(errors).max() < 4.0 * math.sqrt(fulcrum["var_tip"])


def test_given_fulcrum_stays():
    fulcrum = dut(given=G.tolist())
    state, errors, _ = track(fulcrum, moving(60), seed=8)
    np.testing.assert_array_equal(state.g, G)
    assert np.sqrt((errors**2).sum(axis=1).mean()) < 0.25e-3
