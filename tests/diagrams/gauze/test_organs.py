"""Organs in the whole loop."""

import numpy as np
import pytest

from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.gauze import organs
from diagrams.gauze.plots import plots
from diagrams.studies import load_scenario
from systems.motion.tissue_press import Phase
from tests.runs import run


def test_the_lobe_is_passed_and_nothing_touched():
    figures = run("gauze_organs").metrics
    assert figures["reached"]
    assert figures["max_tissue_force"] == 0.0
    assert figures["min_organ_clearance"] >= 0.002
    assert figures["min_tool_clearance"] >= 0.002
    assert figures["time_ratio"] < 1.3


THROUGH = (
    "behaviour=field",
    "clearance_constraint.active=false",
    "time_ratio=false",
    "duration=3.0",
)


def test_without_constraint_and_bypass_it_would_go_through():
    through = run("gauze_organs", *THROUGH)
    assert through.metrics["min_organ_clearance"] < -0.005
    assert through.metrics["max_tissue_force"] > 1.0
    assert np.isfinite(through.organs.touch.f).all()


def test_where_tissue_is_not_to_push_back_the_first_touch_ends_the_run(monkeypatch):
    monkeypatch.setattr(organs, "pushes_back", lambda scenario: False)
    stopped = simulate(load_scenario("gauze_organs", list(THROUGH)))
    assert "organ_touch.acts" in stopped.error
    assert stopped.simulated < 1.0
    assert stopped.organs.touch.depth.max() == 0.0


def test_a_press_feels_the_tissue():
    with pytest.raises(ScenarioError, match="acts"):
        load_scenario("gauze_press", ["organ_touch.acts=false"])


def test_it_is_passed_on_a_patient_who_breathes():
    figures = run("gauze_organs_breathing").metrics
    assert figures["reached"]
    assert figures["max_tissue_force"] == 0.0
    assert figures["min_organ_clearance"] >= 0.002


def test_gauze_is_pressed_on_the_liver_by_force():
    pressed = run("gauze_press")
    figures, status = pressed.metrics, pressed.press.status
    assert figures["reached"]
    assert status.held[-1] == 1.0
    assert status.phase[-1] == Phase.DONE
    assert figures["press_force_worst"] == pytest.approx(0.5, abs=0.1)
    # It dabs until four of its sigmas are within the tolerance.
    sigma, holding = pressed.press.touch.sigma, np.round(status.phase) == Phase.HOLDING
    assert 2 <= status.touches[-1] < pressed.scenario.press.touches
    assert sigma[holding].max() < 0.25 * 0.1 + 1e-3
    force = np.linalg.norm(pressed.organs.touch.f, axis=1)
    assert 1.9 < holding.sum() / 30.0 < 2.1
    # The wall's force is told apart: what is left hardly changes.
    error = pressed.press.touch.force[holding] - force[holding]
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert error.std() < 0.02
    assert force[status.phase < Phase.PRESSING].max() == 0.0


def test_clearance_and_force_are_drawn():
    upper, lower = plots(run("gauze_press"))["organs"].axes
    assert len(upper.lines) == 1 + 4
    assert [line.get_label() for line in lower.lines][:2] == [
        "tissue, true",
        "as R has it",
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("wrist=known", "expected 'pwe' with press.active"),
        ("tip_load.active=true", "tip_load.active=True: expected False with press"),
        ("organs=[]", "expected one to press on"),
        ("organs=[{name: liver, file: nowhere.stl}]", "expected a file"),
        ("organs=[{name: liver, shape: spleen}]", "one of liver"),
        ("organs=[{name: target}]", "expected names that differ"),
    ],
)
def test_bad_organs_are_refused(change, said):
    overrides = [change]
    if change == "wrist=known":
        overrides.append("wall_motion={}")
    with pytest.raises(ScenarioError, match=said):
        load_scenario("gauze_press", overrides)
