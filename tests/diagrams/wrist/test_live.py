"""The wrist live: the tip is led by a hand, the patient coughs."""

import numpy as np

from diagrams.live.session import NEVER
from tests.lively import assert_plays_back, begin, play


def test_a_hand_leads_the_tip_and_it_plays_back(tmp_path):
    session = begin("pwe_arc_breathing")
    start = np.array(session.scenario.robot.p_WP)
    presses = {50: "cough", 70: "wrong fulcrum"}
    play(session, 120, {"tip x [mm]": 20.0, "tip z [mm]": -10.0}, presses)
    run = assert_plays_back(session, "robot.tool", tmp_path)
    moved = run.robot.tool.tip[-1] - start
    np.testing.assert_allclose(moved, [0.02, 0.0, -0.01], atol=4e-3)
    speeds = np.linalg.norm(np.diff(run.robot.tool.tip, axis=0), axis=1) * 120.0
    assert 0.02 < speeds.max() < 0.08
    wall = run.wall.fulcrum.p[:, 2]
    assert wall.max() - wall[:90].max() > 0.003  # thrown
    kinds = [(f.kind, f.start < NEVER) for f in run.scenario.faults]
    assert kinds == [("fulcrum_aside", True), ("force_silent", False)]
