"""Tools that touch in the whole loop: forces, and why the robot stands."""

import numpy as np
import pytest

from diagrams.common.scenario import ScenarioError
from diagrams.gauze.plots import plots
from diagrams.studies import load_scenario
from systems.common.stops import Stop
from tests.runs import run


def test_a_push_is_felt_and_given_way_to():
    pushed = run("gauze_touched")
    figures = pushed.metrics
    assert figures["contact"]
    assert 1.0 < figures["max_hand_force"] < 5.0
    assert figures["max_grip_force"] < figures["max_hand_force"]
    assert figures["max_lateral_force_3s"] < 5.0
    assert Stop.TOUCHED.text in [stop["reason"] for stop in figures["stops"]]
    assert figures["final_tip_error"] < 0.002  # it comes back to S
    # What R has of the push is what pushes it, once it stands still again.
    true = np.linalg.norm(pushed.hand_force.f.reshape(-1, 3), axis=1)
    felt = np.linalg.norm(pushed.wrist.touch.f, axis=1)
    both = (true > 0.3) & (pushed.wrist.touch.touched > 0.5)
    assert np.median(np.abs(true - felt)[both]) < 0.25
    assert plots(pushed)["contact"].axes[0].lines


def test_who_does_not_give_way_is_pushed_harder():
    stiff = run("gauze_touched", "touch_yield.active=false", "duration=9.0").metrics
    assert stiff["max_hand_force"] > 5.0
    assert stiff["max_lateral_force_3s"] > 5.0
    assert Stop.TOUCHED.text not in [stop["reason"] for stop in stiff["stops"]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("wrist=known", "wrist='known': expected 'pwe' with touch_yield.active"),
        ("obstacle.tracked=''", "no obstacle.tracked with held_tools.active"),
        ("held_tools.contact_stiffness=5e2", "expected >= 2"),
        ("wall_motion.step=[0.003, 0, 0]", "the wall does more than breathe"),
        ("wall_motion.irregular.jitter=0.1", "the wall does more than breathe"),
        ("abdomen.turning_stiffness=0.3", "or the trocar resists turning"),
        ("instrument.bending_stiffness=5.3", "False with a shaft that bends"),
    ],
)
def test_what_cannot_be_is_refused(change, said):
    with pytest.raises((ScenarioError, ValueError), match=said):
        load_scenario("gauze_touched", [change])
