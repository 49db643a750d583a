"""Tensions: they balance the torques and stay above the minimum."""

import math

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import bends_of
from plants.snake.tension import length_jacobian, tensions, torques_against

PARAMS = SnakeParams()


def random_angles(rng):
    """a1, b1, ..., b3 within the cone beta <= max_bend."""
    while True:
        x = np.append(0.0, rng.uniform(-PARAMS.max_bend, PARAMS.max_bend, 6))
        if (bends_of(x)[2::2] <= PARAMS.max_bend).all():
            return x[1:]


def lengths(ab):
    return wire_lengths([0.0, *ab], PARAMS)


def test_length_jacobian_matches_differences():
    rng = np.random.default_rng(0)
    for _ in range(30):
        ab = random_angles(rng)
        J = length_jacobian(ab, PARAMS)
        for i in range(6):
            d = np.zeros(6)
            d[i] = 1e-6
            numeric = (lengths(ab + d) - lengths(ab - d)) / 2e-6
            np.testing.assert_allclose(J[:, i], numeric, atol=2e-8)


def test_tensions_balance_any_load_and_are_never_below_the_minimum():
    rng = np.random.default_rng(1)
    for _ in range(300):
        ab, tau = random_angles(rng), rng.normal(scale=0.02, size=6)
        T = tensions(ab, tau, PARAMS, least=1.0)
        np.testing.assert_allclose(length_jacobian(ab, PARAMS).T @ T, -tau, atol=1e-14)
        np.testing.assert_allclose(T.reshape(3, 3).min(axis=1), 1.0, rtol=1e-12)


def test_unloaded_and_fully_bent_takes_a_few_newtons():
    """At 45 deg the null vector's entries differ by 1/0.21, so 1 N asks for 4.7."""
    worst = 0.0
    for turn in np.linspace(0, 2 * math.pi, 73):
        x, y = math.cos(turn) * math.sin(0.785), math.sin(turn) * math.sin(0.785)
        a, b = math.atan2(-y, math.cos(0.785)), math.asin(x)
        T = tensions([a, b] * 3, np.zeros(6), PARAMS)
        worst = max(worst, T.max())
    assert worst == pytest.approx(4.71, abs=0.02)


def test_tensions_hold_a_load_at_the_tip():
    """By moments for a newton across the straight robot's tip, and virtual work.

    A module's balls bend alike, so wires balance the mean of their two moments.
    """
    params = SnakeParams(tool_offset=6e-3)
    tau = torques_against(np.zeros(7), [1.0, 0.0, 0.0], params)
    T = tensions(np.zeros(6), tau, params, least=1.0)
    across = -T @ np.cos(np.ravel(params.azimuths()))
    lever = 12 * params.half_pitch + params.tool_offset  # from the first ball
    mean = lever - params.half_pitch
    assert params.ball_radius * across == pytest.approx(mean, rel=1e-9)
    rng = np.random.default_rng(2)
    for _ in range(20):
        ab, force = random_angles(rng), rng.normal(size=3)
        T = tensions(ab, torques_against([0.0, *ab], force, PARAMS), PARAMS)
        d = 1e-6 * rng.normal(size=6)
        tips = [forward([0.0, *(ab + s * d)], PARAMS)[:3, 3] for s in (-1, 1)]
        work = force @ (tips[1] - tips[0])
        wound = T @ (lengths(ab + d) - lengths(ab - d))
        assert work == pytest.approx(wound, abs=1e-9)


def test_all_wires_can_be_taut_only_under_the_inequality():
    loose = SnakeParams(ball_radius=2e-3, half_pitch=3.6e-3)
    least = math.inf
    for params in (PARAMS, loose):
        ratios = []
        for turn in np.linspace(0, 2 * math.pi, 181):
            x, y = math.cos(turn) * math.sqrt(0.5), math.sin(turn) * math.sqrt(0.5)
            J = length_jacobian(
                [math.atan2(-y, math.sqrt(0.5)), math.asin(x), 0, 0, 0, 0], params
            )
            null = np.cross(J[:3, 0], J[:3, 1])
            null *= np.sign(null.sum())
            ratios.append(null.min() / null.max())
        least = min(ratios)
        assert (least > 0.0) == (params is PARAMS)
