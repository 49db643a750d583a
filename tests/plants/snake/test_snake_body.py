"""The body: its limits, and driving it."""

import numpy as np

from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import OK, body_of, check_limits, drive
from tests.ball import ball_session


def test_limits_are_a_cone():
    body = body_of(SnakeParams())
    assert check_limits(body, np.array([0, 0.7, 0.0, 0, 0, 0, 0.0])) == OK
    assert check_limits(body, np.array([0, 0.7, 0.7, 0, 0, 0, 0.0])) != OK
    assert check_limits(body, np.array([0.2, 0, 0, 0, 0, 0, 0.0])) != OK


def test_a_way_once_driven_is_open_both_ways():
    session = ball_session()
    s, b, why = session.volume.space(), session.body, session.why
    home = session.home
    deeper = home.copy()
    deeper[0] += 0.01
    assert drive(s, b, home, deeper, 1, why) == OK
    freed = int(s.used[0])
    assert freed > 0
    assert drive(s, b, deeper, home, 2, why) == OK
    assert s.used[0] == freed


def test_a_way_that_fails_leaves_nothing():
    session = ball_session()
    s, b, why = session.volume.space(), session.body, session.why
    tau = session.volume.tau.copy()
    beyond = session.home.copy()
    beyond[0] += 0.04  # out of the tumour's far side
    assert drive(s, b, session.home, beyond, 1, why) != OK
    np.testing.assert_array_equal(session.volume.tau, tau)
    assert not session.volume.roomy.any()
