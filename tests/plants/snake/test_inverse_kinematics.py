"""Inverse kinematics against forward kinematics."""

import math

import numpy as np
import pytest

from plants.snake.inverse_kernels import (
    BEND,
    LAST_BEND,
    REACHED,
    TRAVEL_HIGH,
    TRAVEL_LOW,
)
from plants.snake.inverse_kinematics import positioning, tool_posture, tool_postures
from plants.snake.kinematics import forward
from plants.snake.last_module import bend_for_radius, entry, last_module, meridian
from plants.snake.parameters import SnakeParams
from plants.snake.posture import bends_of, posture_of
from systems.common.parameter import check

PARAMS = SnakeParams()


def random_bends(count, seed=0, params=PARAMS):
    """(s, alpha1, beta1, ..., beta3), (count, 7)."""
    rng = np.random.default_rng(seed)
    q = np.empty((count, 7))
    q[:, 0] = rng.uniform(*params.travel, count)
    q[:, 1::2] = rng.uniform(-math.pi, math.pi, (count, 3))
    q[:, 2::2] = rng.uniform(0.0, params.max_bend, (count, 3))
    return q


def intermediate(x5, params=PARAMS):
    """p_WI and n_WI: the tool's pose with module 3 straight, moved back to O2."""
    x = np.concatenate([x5, np.zeros((*np.shape(x5)[:-1], 2))], axis=-1)
    X = forward(x, params)
    n = X[..., :3, 2]
    return X[..., :3, 3] - (params.straight_module + params.tool_offset) * n, n


@pytest.mark.parametrize("max_bend", [math.pi / 4, 0.6, 0.25])
def test_every_reachable_pose_has_its_posture(max_bend):
    params = check(SnakeParams(max_bend=max_bend))
    q = random_bends(20_000, params=params)[:, :5]
    p, n = intermediate(posture_of(q), params)
    answer = positioning(p, n, params)
    assert answer.reached.all()
    p_back, n_back = intermediate(answer.x, params)
    assert np.linalg.norm(p_back - p, axis=1).max() <= 1e-9
    assert np.abs(n_back - n).max() <= 1e-12
    found = bends_of(answer.x)
    assert np.abs(found[:, [0, 2, 4]] - q[:, [0, 2, 4]]).max() < 1e-9
    assert (found[:, 2::2] <= max_bend + 1e-12).all()


@pytest.mark.parametrize(
    "q5",
    [
        [0.05, 0.0, 0.0, 0.0, 0.0],
        [0.05, 1.0, 0.3, 0.0, 0.0],
        [0.05, 0.0, 0.0, 1.0, 0.3],
        [0.05, 0.3, 0.2, 0.3 + math.pi, 0.2],  # S: axis along z
        [0.05, 0.3, math.pi / 4, 2.0, math.pi / 4],
        [0.05, 0.3, math.pi / 4, 0.3, math.pi / 4],  # U-turn, a double root
        [0.05, 0.3, math.pi / 4, 0.3, math.pi / 4 - 1e-5],
        [PARAMS.travel[0], 0.3, 0.1, 2.0, 0.4],
        [PARAMS.travel[1], 0.3, 0.1, 2.0, 0.4],
    ],
)
def test_special_poses(q5):
    p, n = intermediate(posture_of(q5))
    answer = positioning(p, n, PARAMS)
    assert answer.status == REACHED
    p_back, n_back = intermediate(answer.x)
    np.testing.assert_allclose(p_back, p, atol=1e-12)
    np.testing.assert_allclose(n_back, n, atol=1e-10)


def test_the_posture_is_unique():
    """From any other start a general solver finds the same posture or none."""
    from scipy.optimize import least_squares

    rng = np.random.default_rng(4)
    for q in random_bends(8, seed=9)[:, :5]:
        p, n = intermediate(posture_of(q))

        def error(x, p=p, n=n):
            p_x, n_x = intermediate(posture_of(x))
            return np.concatenate([(p_x - p) * 100, n_x - n])

        for _ in range(6):
            start = np.array([*random_bends(1, rng.integers(1 << 30))[0, :5]])
            found = least_squares(error, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
            if found.cost < 1e-24 and (np.abs(found.x[2::2]) <= PARAMS.max_bend).all():
                bends = np.abs(found.x[[0, 2, 4]])
                np.testing.assert_allclose(bends, np.abs(q[[0, 2, 4]]), atol=1e-7)


def test_travel_is_named():
    p, n = intermediate(posture_of([0.0, 0.3, 0.2, 1.0, 0.4]))
    low, high = PARAMS.travel
    far = positioning(np.add(p, [[0, 0, low - 1e-4], [0, 0, high + 1e-4]]), n, PARAMS)
    assert far.status.tolist() == [TRAVEL_LOW, TRAVEL_HIGH]
    assert positioning([0.05, 0, 0], [0, 0, 1], PARAMS).status == BEND


def test_tool_poses():
    x = posture_of(random_bends(20_000, seed=2))
    X = forward(x, PARAMS)
    n_WI = intermediate(x[:, :5])[1]
    answer = tool_postures(X[:, :3, 3], X[:, :3, 2], n_WI, PARAMS)
    assert answer.reached.all()
    back = forward(answer.x, PARAMS)
    assert np.abs(back[:, :3, 3] - X[:, :3, 3]).max() <= 1e-9
    assert np.abs(back[:, :3, 2] - X[:, :3, 2]).max() <= 1e-12
    assert np.abs(bends_of(answer.x)[:, 6] - bends_of(x)[:, 6]).max() < 1e-9
    for i in range(20):
        target = np.concatenate([X[i, :3, 3], 2 * X[i, :3, 2], 3 * n_WI[i]])
        one, status = tool_posture(target, PARAMS)
        assert status == REACHED
        np.testing.assert_allclose(one, answer.x[i], atol=1e-9)
    across = tool_postures([0, 0, 0.05], [0, 0, 1], [1, 0, -0.1], PARAMS)
    assert across.status == LAST_BEND


def test_last_module_and_entry_in_closed_form():
    for radius in np.linspace(0.0, float(meridian(PARAMS.max_bend, PARAMS)[0]), 50):
        beta = bend_for_radius(radius, PARAMS)
        assert 0.0 <= beta <= PARAMS.max_bend
        assert float(meridian(beta, PARAMS)[0]) == pytest.approx(radius, abs=1e-15)
    x = entry([0.006, -0.008, 0.030], PARAMS)
    assert (x[1:5] == 0.0).all()
    np.testing.assert_allclose(
        forward(x, PARAMS)[:3, 3], [0.006, -0.008, 0.030], atol=1e-15
    )
    alpha, _, gap = last_module([0.0, 0.01, 0.02], PARAMS)
    assert alpha == pytest.approx(math.pi / 2)
    assert gap == pytest.approx(
        0.02 - meridian(bend_for_radius(0.01, PARAMS), PARAMS)[1]
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: positioning([0, 0], [0, 0, 1], PARAMS), r"p_WI has shape \(2,\)"),
        (lambda: positioning([0, 0, 0], [0, 0, 0], PARAMS), "n_WI holds a zero"),
        (lambda: positioning([0, math.nan, 0], [0, 0, 1], PARAMS), "not finite"),
        (lambda: bend_for_radius(0.02, PARAMS), "radius=0.02 m.*nearest: 0.0139255"),
        (lambda: entry([0, 0, 0.5], PARAMS), "translation s=.*outside its travel"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
