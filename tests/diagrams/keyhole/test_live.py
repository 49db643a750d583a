"""An operation live."""

import numpy as np
import pytest

from tests.lively import assert_plays_back, begin, play


@pytest.mark.study
def test_a_cough_and_lost_sight_play_back(tmp_path):
    session = begin("keyhole_circle")
    play(session, 180, {}, {60: "cough", 100: "lose sight"})
    assert session.words.startswith("station")
    run = assert_plays_back(session, "robot.tool", tmp_path)
    thrown = run.organ.true.p[:, 2]
    assert thrown.max() - np.median(thrown) > 0.004
