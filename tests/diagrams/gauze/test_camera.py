"""The camera that plans beside the one that follows S, in the whole loop."""

import pytest

from tests.runs import run

pytestmark = pytest.mark.xdist_group("gauze")
FOLLOWS = "camera_planner.active=false"


def test_it_sees_both_tips_and_moves_less():
    plans, follows = (run("camera_follow", *x).metrics for x in ((), (FOLLOWS,)))
    assert plans["reached"]
    assert plans["tips_in_view"] >= 0.995
    assert plans["camera_path"] < 0.6 * follows["camera_path"]


def test_it_moves_out_of_what_would_block_it():
    plans, follows = (run("camera_blocked", *x).metrics for x in ((), (FOLLOWS,)))
    assert plans["tips_in_view"] >= 0.95
    assert follows["tips_in_view"] < 0.6
    assert plans["min_camera_clearance"] > 0.004
    assert plans["min_organ_clearance"] >= 0.002
