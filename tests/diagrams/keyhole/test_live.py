"""An operation live: a hand beside the tube, a cough, lost sight."""

from plants.abdomen.breath import COUGH
from tests.lively import assert_plays_back, begin, play


def test_a_hand_a_cough_and_lost_sight_play_back(tmp_path):
    session = begin("keyhole_approach")
    hand = session.values("obstacle.shaft")[:3].copy()
    play(session, 90, {"obstacle y [mm]": 5.0}, {40: "cough", 60: "lose sight"})
    run = assert_plays_back(session, "robot.tool", tmp_path)
    assert run.obstacle.shaft.tip[-1, 1] - hand[1] > 0.004
    # Wall and organ are thrown, and come back.
    (start,) = run.scenario.wall_motion.irregular.coughs
    time = run.signals["time"]
    thrown = (time > start) & (time < start + COUGH)
    for z in (run.wall.fulcrum.p[:, 2], run.organ.true.p[:, 2]):
        assert z[thrown].max() - max(z[~thrown].max(), z[-1]) > 0.002
    assert session.words.startswith("probe")
