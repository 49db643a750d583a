"""The wrist's scenarios must show the issue's figures, with the arm in the loop."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.bedside.wrist_metrics import last_above, settled
from diagrams.common.case import Case
from diagrams.common.run import prepare, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.studies import load_scenario
from diagrams.wrist.plots import plots
from diagrams.wrist.scenario import UNLIMITED
from tests.runs import run


def test_arcs_about_a_wrong_guess():
    figures = run("pwe_arc").metrics
    assert figures["fulcrum_convergence_time"] <= 7.0  # the arcs begin at 5
    assert figures["rms_lateral_force"] <= 0.1
    assert figures["lateral_convergence_time"] <= 5.5
    assert figures["estimates_refused"] == 0


def test_arcs_under_breathing():
    figures = run("pwe_arc_breathing").metrics
    assert 5.0 < figures["fulcrum_convergence_time"] <= 10.0
    assert figures["fulcrum_error_3s"] <= 2e-3
    assert figures["rms_lateral_force"] <= 0.1
    assert figures["breathing_rate_estimate"] == pytest.approx(0.2, rel=0.02)


def test_a_bent_shaft_is_led_as_a_straight_one():
    bent = ["duration=6", "compare=[]", "instrument.bending_stiffness=5.3"]
    blind = run("pwe_arc", *bent).metrics
    told = run("pwe_arc", *bent, "shaft_bend.active=true").metrics
    assert told["rms_lateral_force"] <= 0.5 * blind["rms_lateral_force"]
    assert told["rms_lateral_force"] <= 0.03
    assert told["rms_bend_error"] <= 2e-4


def test_step_of_the_wall():
    figures = run("pwe_step").metrics
    assert figures["time_to_2N"] <= 0.25
    assert figures["time_to_02N"] <= 0.45
    assert figures["time_frozen"] == 0.0
    assert figures["jumps_followed"] == 1


def noticed(r, start):
    """When the monitor found navigation not to be accurate, from a time on [s]."""
    time, told = r.signals["time"], r.wrist.accuracy
    return float(time[(time >= start) & (told.accurate < 0.5)][0] - start)


def test_whether_navigation_is_accurate_is_said_while_it_runs():
    for name in ("pwe_arc", "pwe_arc_breathing", "pwe_breathing", "pwe_insufflation"):
        clean = run(name)
        assert clean.metrics["accuracy_alarms"] == 0
        assert clean.metrics["time_inaccurate"] < 2.0  # the probe
        late = clean.signals["time"] > 2.0
        assert clean.wall.fulcrum_error.distance[late].max() < 1e-3
    step = run("pwe_step")
    assert step.metrics["accuracy_alarms"] == 1
    assert noticed(step, 5.0) < 0.05
    assert step.wrist.accuracy.accurate[-1] == 1.0  # followed
    for kind, size, within in (
        ("fulcrum_aside", 0.005, 0.05),
        ("force_bias", 0.3, 0.3),
    ):
        fault = f"faults=[{{kind: {kind}, start: 4, duration: 2, size: {size}}}]"
        wrong = simulate(load_scenario("pwe_arc", ["compare=[]", fault], duration=7.0))
        assert noticed(wrong, 4.0) < within
        assert wrong.metrics["accuracy_alarms"] == 1


def test_breathing_under_a_ventilator_against_the_printed_law():
    figures = run("pwe_breathing").metrics
    assert figures["rms_lateral_force"] <= 0.08
    assert figures["rms_fulcrum_error"] <= 0.15e-3
    printed = run("pwe_breathing", "wrist=spring").metrics
    assert printed["rms_lateral_force"] >= 3.0 * figures["rms_lateral_force"]


def test_insufflation():
    figures = run("pwe_insufflation").metrics
    assert figures["max_lateral_force"] <= 0.2
    assert figures["time_frozen"] == 0.0


def test_known_fulcrum_under_breathing():
    scenario = load_scenario("pwe_breathing", ["wrist=known"], duration=8.0)
    figures = simulate(Case(replace(scenario, measure_from=2.0))).metrics
    assert figures["rms_lateral_force"] < 0.03


def test_off_gives_way_whenever_the_wall_is_loaded():
    figures = run("pwe_arc", "wrist=off").metrics
    assert 5.0 < figures["max_lateral_force"] < 10.0
    assert figures["time_over_limit"] < 6.0 < 10.0 < figures["time_frozen"]


def test_a_lost_sensor_stops_the_task_until_it_is_back():
    overrides = ["tool_wrench.lost=[7.0, 8.0]"]
    result = simulate(Case(load_scenario("pwe_arc", overrides, duration=10.0)))
    t, code = result.signals["time"], result.wrist.permission.code
    assert np.all(code[(t > 7.1) & (t < 8.0)] == 9.0)
    assert np.all(code[t > 8.4] == 0.0)
    tip = result.robot.tool.tip
    still = (t > 7.3) & (t < 8.0)
    assert np.ptp(tip[still], axis=0).max() < 2e-4
    assert np.ptp(tip[t > 8.5], axis=0).max() > 5e-3


def test_same_seed_same_figures():
    one, two = (
        simulate(Case(load_scenario("pwe_breathing", duration=1.0))) for _ in range(2)
    )
    np.testing.assert_array_equal(one.wrist.fulcrum.p, two.wrist.fulcrum.p)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("wrist=passive", "expected one of pwe, spring, off, known"),
        ("first_guess=[0.2, 0.0, 0.0]", "first_guess=.* m: .*<= 0.05"),
        ("abdomen.stiffness=-500.0", "abdomen.stiffness=-500.0 N/m: expected >= 10"),
        ("fulcrum_estimator.stiffness=-1.0", "fulcrum_estimator.stiffness=-1.0 N/m"),
        ("tool_wrench.period=0.01", "joints.period=.* shared by both"),
        ("tool_wrench.frame=7", "expected a text"),
        ("instrument.bending_stiffness=0.5", "stiffness=0.5 N m.2: expected 0 or >= 2"),
        ("compare=[pew]", "compare=.'pew'.: expected one of pwe"),
        ("wall_motion.wave=square", "wave='square': expected one of sine, ventilator"),
    ],
)
def test_bad_input(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("pwe_arc", [override])


def test_modes_that_are_compared_are_run_at_the_highest_force_limit():
    scenario = load_scenario(
        "pwe_arc", ["compare=[off, known]", "measure_from=0"], duration=0.1
    )
    run = simulate(prepare(scenario))
    assert list(run.case.companions) == ["off", "known"]
    for mode, beside in run.case.companions.items():
        assert beside.scenario.wrist == mode
        assert beside.scenario.passive_wrist.force_limit == UNLIMITED
    labels = plots(run)["forces"].axes[0].get_legend().get_texts()
    assert len(labels) == 3


def test_settled_and_last_above():
    t = np.arange(5.0)
    assert settled(t, np.array([0.0, 3.0, 0.0, 0.0, 0.0]), 1.0) == 2.0
    assert settled(t, np.zeros(5), 1.0) == 0.0
    assert settled(t, np.array([0.0, 0.0, 0.0, 0.0, 9.0]), 1.0) is None
    assert last_above(t, np.array([0.0, 9.0, 3.0, 1.0, 0.0]), 2.0) == 3.0


@pytest.mark.study
def test_a_late_sensor_costs_little_when_force_and_pose_belong_together():
    figures = run("pwe_breathing", "tool_wrench.delay=2").metrics
    assert figures["rms_lateral_force"] < 0.15
    assert figures["max_lateral_force"] < 1.0
