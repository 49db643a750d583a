"""A navigation live: an obstacle is driven into the robot's way."""

import numpy as np

from plants.crowd.guided_disc import GuidedDisc, Place
from plants.crowd.signals import filled
from tests.lively import assert_plays_back, begin, play


def test_an_obstacle_is_driven_and_it_plays_back(tmp_path):
    session = begin("nav_one_static")
    start = session.scenario.obstacles[0].start
    play(session, 120, {"obstacle x [m]": -0.5, "obstacle y [m]": 1.0}, {})
    run = assert_plays_back(session, "robot.state", tmp_path)
    driven = np.array([run.obstacles.rows.x[:, 0], run.obstacles.rows.y[:, 0]]).T
    np.testing.assert_allclose(driven[0], start, atol=0.03)
    np.testing.assert_allclose(driven[-1] - start, [-0.5, 1.0], atol=0.06)
    speed = np.hypot(run.obstacles.rows.v_x[:, 0], run.obstacles.rows.v_y[:, 0])
    assert 0.7 < speed.max() <= 0.8 + 1e-9
    assert session.words in ("attractive", "bypass", "leave", "yield")


def test_a_crowd_is_not_driven():
    session = begin("nav_crowd")
    play(session, 4, {}, {})
    assert session.time == 0.2
    assert session.words in ("attractive", "bypass")


def test_a_driver_who_says_nothing_rests():
    disc = GuidedDisc(start=Place(1.0, 2.0))
    context = disc.CreateDefaultContext()
    disc.GetInputPort("others").FixValue(context, filled([]))
    disc.GetInputPort("wanted").FixValue(context, [np.nan, 0.0])
    new = disc.EvalUniquePeriodicDiscreteUpdate(context).value()
    np.testing.assert_array_equal(new, [1.0, 2.0, 0.0, 0.0, 0.0])
