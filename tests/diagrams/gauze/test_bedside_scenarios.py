"""The bedside as it is: the twins with everything on keep what is asked of them."""

import numpy as np
import pytest

from diagrams.common.scenario import ScenarioError
from diagrams.studies import load_scenario
from tests.runs import run

KEYS = {
    *("max_lateral_force_3s", "rms_lateral_force_3s", "min_gauze_clearance"),
    *("rms_tip_force_error", "registration_error", "unavoidable"),
    *("depth_convergence_time", "lateral_convergence_time"),
}


def test_with_everything_on_the_gauze_arrives():
    r = run("gauze_dynamic_real")
    figures = r.metrics
    assert set(figures) >= KEYS
    assert figures["reached"] and figures["min_tool_clearance"] > 0.002
    assert figures["rms_lateral_force_3s"] < 0.5 and figures["max_lateral_force_3s"] < 3
    assert figures["final_tip_error"] < 1e-3
    assert figures["registration_error"] < 3e-4
    assert figures["rms_tip_force_error"] < 0.15
    # The push is told within 0.1 s of its full size, and only then.
    time, tip = r.signals["time"], r.wrist.tip_force
    push = r.scenario.tip_push
    touched = time[tip.contact > 0.5]
    assert push.start < touched[0] < push.start + push.rise + 0.1
    assert touched[-1] < push.start + push.duration + 0.5
    # Every trocar moved: where O's shaft is at the wall's height.
    shaft = r.obstacle.shaft
    at_wall = shaft.tip - shaft.u * (shaft.tip[:, 2:] / shaft.u[:, 2:])
    assert np.ptp(at_wall, axis=0).max() > 0.004


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("obstacle.hand.top_speed=9", r"top_speed=9.0 m/s: expected"),
        ("obstacle.breathing=[1,0,0]", r"breathing.*expected"),
        ("abdomen.turning_stiffness=-1", r"turning_stiffness=-1.0 N m/rad"),
        ("tip_push.force=[99,0,0]", r"force"),
        ("tracker.shift=[1,0,0]", r"shift"),
        ("registration.first_turn=9", r"first_turn=9.0 rad"),
    ],
)
def test_bad_input_is_told_before_the_run(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("gauze_static", [override])


def test_a_tool_that_hunts_has_no_hand_of_its_own():
    with pytest.raises(
        ScenarioError, match=r"hunt.speed=0.01 m/s: expected 0 together"
    ):
        load_scenario("gauze_static", ["hunt.speed=0.01", "obstacle.hand.seed=3"])
