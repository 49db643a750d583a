"""Refused poses: the limit named and the nearest pose, against other computations."""

import math

import numpy as np
import pytest

from plants.snake.inverse_kinematics import positioning
from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import bends_of, posture_of
from plants.snake.reachability import refusal
from systems.common.parameter import check

PARAMS = SnakeParams()
Z = np.array([0.0, 0.0, 1.0])


def random_poses(count, seed):
    rng = np.random.default_rng(seed)
    n = rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    p = np.c_[rng.uniform(-0.06, 0.06, (count, 2)), rng.uniform(-0.09, 0.18, count)]
    return p, n


def sampled_positions(n, rng, count=20_000):
    """Positions at s = 0 for one axis, by axes v drawn from the whole sphere."""
    v = rng.normal(size=(count, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]
    v = v[(v[:, 2] >= 0.0) & (v @ n >= 0.0)]  # both modules bend 90 deg at most
    mid1 = (v + Z) / np.linalg.norm(v + Z, axis=1)[:, None]
    mid2 = (v + n) / np.linalg.norm(v + n, axis=1)[:, None]
    return 2 * PARAMS.half_pitch * (mid1 + v + mid2 + n)


def check_refusal(p, n, rng):
    answer = refusal(p, n, PARAMS)
    assert answer is not None and answer.limits
    # The nearest pose is one, and as far away as said.
    back = forward(np.append(answer.x, [0.0, 0.0]), PARAMS)
    p_back = back[:3, 3] - (PARAMS.straight_module + PARAMS.tool_offset) * back[:3, 2]
    np.testing.assert_allclose(p_back, answer.p_WI, atol=1e-9)
    np.testing.assert_allclose(back[:3, 2], n, atol=1e-9)
    assert np.linalg.norm(p - answer.p_WI) == pytest.approx(answer.gap, abs=1e-9)
    # The limits named are the ones its posture stands on.
    s, _, beta1, _, beta2 = bends_of(answer.x)
    on = {
        "beta1": beta1 > PARAMS.max_bend - 1e-5,
        "beta2": beta2 > PARAMS.max_bend - 1e-5,
        "s_min": s < PARAMS.travel[0] + 1e-9,
        "s_max": s > PARAMS.travel[1] - 1e-9,
    }
    assert answer.limits == [name for name, there in on.items() if there]
    if rng is None:
        return answer
    # No sampled pose is nearer, and lifting only the limits named lets it nearer.
    gap = p - sampled_positions(n, rng)
    gap[:, 2] -= np.clip(gap[:, 2], *PARAMS.travel)
    if len(gap):
        assert np.linalg.norm(gap, axis=1).min() > answer.gap - 1e-9
    return answer


def test_refused_poses():
    p, n = random_poses(250, seed=5)
    rng = np.random.default_rng(6)
    refused = ~positioning(p, n, PARAMS).reached
    assert refused.sum() > 200
    for i in np.flatnonzero(refused):
        check_refusal(p[i], n[i], rng)
    for i in np.flatnonzero(~refused):
        assert refusal(p[i], n[i], PARAMS) is None


@pytest.mark.study
def test_5000_refused_poses():
    p, n = random_poses(5200, seed=7)
    refused = np.flatnonzero(~positioning(p, n, PARAMS).reached)[:5000]
    assert len(refused) == 5000
    for i in refused:
        check_refusal(p[i], n[i], None)


@pytest.mark.parametrize(
    ("limit", "q5"),
    [
        ("beta1", [0.02, 0.4, 1.02 * math.pi / 4, 2.0, 0.4]),
        ("beta1", [0.02, 0.4, 1.02 * math.pi / 4, -1.0, 0.1]),
        ("beta2", [0.02, 0.4, 0.4, 2.0, 1.02 * math.pi / 4]),
        ("beta2", [0.02, 0.4, 0.1, 2.0, 1.02 * math.pi / 4]),
        ("s_min", [PARAMS.travel[0] - 1e-4, 0.4, 0.1, 2.0, 0.2]),
        ("s_max", [PARAMS.travel[1] + 1e-4, 0.4, 0.4, 2.0, 0.2]),
    ],
)
def test_a_pose_past_one_limit_is_stopped_by_that_limit(limit, q5):
    X = forward(posture_of([*q5, 0.0, 0.0]), PARAMS)
    p = X[:3, 3] - (PARAMS.straight_module + PARAMS.tool_offset) * X[:3, 2]
    answer = refusal(p, X[:3, 2], PARAMS)
    assert answer is not None
    assert answer.limits == [limit]
    assert 0.0 < answer.gap < 1e-3
    assert f"stopped by {limit}; nearest reachable position" in str(answer)


def test_an_axis_that_leans_too_far_is_turned():
    params = check(SnakeParams(max_bend=0.5))
    n = [math.sin(2.3), 0.0, math.cos(2.3)]
    answer = refusal([0.01, 0.0, 0.03], n, params)
    assert answer is not None
    assert "tilt" in answer.limits
    assert answer.tilt_gap == pytest.approx(0.3)
    assert answer.n_WI[2] == pytest.approx(math.cos(2.0))
    assert np.isfinite(answer.x).all()
