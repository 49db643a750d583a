"""Dead reckoning is exact without errors, and wrong by its errors with them."""

from math import cos, sin

import numpy as np
import pytest

from plants.turtlebot.odometry import Odometer, OdometryNoise, OdometryParams, reckon
from plants.turtlebot.signals import RobotState
from systems.common.compiled import packed

EXACT = {"scale": 0.0, "slip": 0.0, "drift": 0.0, "turn": 0.0}


def driven(seed: int, **errors) -> np.ndarray:
    """Reckoned less true x, y, heading after a circle of 1 m radius and a straight."""
    record = packed(OdometryParams(**{**EXACT, **errors}))[0]
    rng = np.random.default_rng(seed)
    state, told = Odometer(*[0.0] * 9), RobotState(0.0, 0.0, 0.0, 0.0, 0.0)
    robot = RobotState(1.0, 2.0, 0.5, 0.5, 0.0)
    for k in range(400):
        noise = OdometryNoise(*rng.standard_normal(4).tolist())
        state, told = reckon(record, state, robot, noise)
        omega = 0.5 if k < 252 else 0.0
        middle, theta = robot.theta + 0.025 * omega, robot.theta + 0.05 * omega
        x, y = robot.x + 0.025 * cos(middle), robot.y + 0.025 * sin(middle)
        robot = RobotState(x, y, theta, 0.5, omega)
    state, told = reckon(record, state, robot, OdometryNoise(*[0.0] * 4))
    return np.subtract(told[:3], robot[:3])


def test_without_errors_it_is_exact():
    np.testing.assert_allclose(driven(1), 0.0, atol=1e-9)


def test_what_stays_wrong_grows_with_the_way():
    errors = np.array([driven(seed, scale=0.01) for seed in range(40)])
    # The circle closes: what is left is the straight's share, 3.7 m of it.
    size = np.hypot(errors[:, 0], errors[:, 1])
    assert np.sqrt(np.mean(size**2)) == pytest.approx(0.037, rel=0.3)
    turned = np.array([driven(seed, drift=1e-3)[2] for seed in range(40)])
    assert np.std(turned) == pytest.approx(0.02, rel=0.3)
