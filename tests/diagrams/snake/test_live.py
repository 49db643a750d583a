"""The snake live: its wires are wound by hand."""

import numpy as np

from tests.lively import assert_plays_back, begin, play


def test_wires_are_wound_by_hand_and_it_plays_back(tmp_path):
    session = begin("snake_circle")
    still = session.values("snake.tool")[:3].copy()
    play(session, 60, {"wire 0 [mm]": -1.0, "wire 1 [mm]": 0.5}, {})
    run = assert_plays_back(session, "snake.tool", tmp_path)
    assert np.linalg.norm(run.snake.tool.p[-1] - still) > 2e-3
    assert np.linalg.norm(run.snake.tool.p[15] - still) < 1e-3
    assert session.words == "wires hold"


def test_a_tension_that_is_not_read_stops_the_drums():
    session = begin("snake_circle")
    play(session, 30, {"translation [mm]": 5.0}, {5: "tension not read"})
    assert session.words == "a wire of module 1 is slack"
    assert session.speed < 1e-4
