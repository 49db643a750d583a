"""The camera that plans beside the one that follows S, in the whole loop."""

import pytest

from tests.runs import run

FOLLOWS = "camera_planner.active=false"
BLOCKED = "camera_blocked"


def test_it_sees_both_tips():
    plans = run("camera_follow").metrics
    assert plans["reached"]
    assert plans["tips_in_view"] >= 0.995


def test_it_moves_out_of_what_would_block_it():
    plans = run(BLOCKED).metrics
    assert plans["tips_in_view"] >= 0.995
    assert plans["min_camera_clearance"] > 0.004
    assert plans["min_organ_clearance"] >= 0.002


@pytest.mark.study
def test_it_sees_more_and_moves_less_than_one_that_follows():
    moves, sees = (run(name, FOLLOWS).metrics for name in ("camera_follow", BLOCKED))
    assert run("camera_follow").metrics["camera_path"] < moves["camera_path"] / 3.0
    assert sees["tips_in_view"] < 0.6 < run(BLOCKED).metrics["tips_in_view"]
