"""One patient, one plant: the scenarios must show the issue's figures."""

import re

import numpy as np
from pydrake.systems.framework import DiagramBuilder
import pytest

from diagrams.bedside.bedside import add_bedside
from diagrams.common.scenario import ScenarioError
from diagrams.keyhole.operation import circle, outline
from diagrams.keyhole.plots import plots
from diagrams.keyhole.scenario import BASE
from diagrams.studies import load_scenario
from plants.instruments.tube import channel_frame
from plants.snake.kinematics import forward
from plants.snake.snake import add_snake
from systems.resection.wires.tip_reference import circle_target
from tests.runs import run

SHORT = "duration=26"


def test_circle():
    figures = run("keyhole_circle", SHORT).metrics
    assert figures["gate_opened"] < 15.0
    assert figures["rms_tool_error"] < 0.08e-3
    assert figures["max_tool_error"] < 0.25e-3
    assert figures["rms_lateral_force"] < 0.1
    assert figures["max_lateral_force_3s"] < 1.0
    assert figures["max_coupler_error"] < 5e-5
    assert [one["phase"] for one in figures["phases"]] == [
        "probe",
        "approach",
        "station",
        "resect",
    ]


def test_what_was_not_measured_is_no_zero():
    figures = run("keyhole_approach", "duration=14").metrics
    assert figures["time_at_work"] == 0.0
    for key in ("rms_tool_error", "max_tool_error", "rms_organ_error", "ik_refused"):
        assert figures[key] is None


def test_the_snake_leaves_the_tube_after_the_gate_alone():
    result = run("keyhole_circle", SHORT)
    time, gate = result.signals["time"], result.metrics["gate_opened"]
    out = result.operation.snake.out
    assert not out[time < gate].any()
    assert out[-1] == 1.0


def test_approach():
    """Round the surgeon's moving tool, unloaded, to the gate."""
    figures = run("keyhole_approach", "duration=14").metrics
    assert figures["min_tool_clearance"] >= 4e-3
    assert figures["gate_opened"] < 14.0
    assert figures["rms_lateral_force"] < 0.15
    assert [one["phase"] for one in figures["phases"]][:3] == [
        "probe",
        "approach",
        "station",
    ]


def test_everything_hangs_on_the_sensor():
    scenario = load_scenario("keyhole_circle", duration=1.0)
    added = []

    def hang(plant, tube):
        frame = channel_frame(plant, tube, scenario.instrument)
        added.append(add_snake(plant, frame, scenario.in_tube).instance)
        return added

    bedside = add_bedside(DiagramBuilder(), scenario, hang)
    plant = bedside.systems["plant"]
    assert plant.num_velocities() == 24
    assert plant.num_constraints() == 6
    names = {plant.GetModelInstanceName(i) for i in bedside.below}
    assert names == {"instrument", "sleeve", "snake"}


def test_a_turn_of_the_circle_is_the_circle():
    scenario = load_scenario("keyhole_circle")
    plan = circle(scenario)
    for time in (0.0, 0.4, 1.3, 7.0, 31.7):
        p, n, _ = circle_target(scenario.circle, time)
        X = forward(plan.posture(time), scenario.in_tube)
        np.testing.assert_allclose(X[:3, 3], p, atol=1e-5)
        np.testing.assert_allclose(X[:3, 2], n, atol=1e-3)


def test_a_resection_is_planned_with_the_base_out_of_the_tube():
    scenario = load_scenario("keyhole_circle", ["task=resect"])
    case = outline(scenario)
    assert case.session.params.travel[0] == -scenario.instrument.gap - BASE
    assert case.plan.posture(0.0)[0] >= -scenario.instrument.gap - BASE


def test_plots():
    figures = plots(run("keyhole_circle", SHORT))
    assert set(figures) == {"course", "estimate"}
    assert len(figures["course"].axes) == 3


def test_replay_holds_the_organ():
    from diagrams.common.replay import start_meshcat
    from diagrams.common.run import simulate

    meshcat = start_meshcat()
    result = simulate(load_scenario("keyhole_circle", duration=0.2), meshcat)
    assert not result.error
    assert meshcat.HasPath("organ/body")
    assert len(meshcat.StaticHtml()) < 15e6


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "entry.p_WE=[0.1, 0.0, -0.1]",
            "vertical, not 45; a trocar .* would do",
        ),
        (
            "entry.p_WE=[0.0, 0.0, -0.3]",
            "m from the trocar, not 0.300; no trocar at this",
        ),
        (
            "entry.p_WE=[0.0, 0.0, -0.2] instrument.length=0.2",
            "instrument.length=0.2 m: expected >= 0.24.*the tube is too short",
        ),
        ("circle.radius=0.05", "circle: "),
        ("task=both", "task='both': expected one of circle, resect"),
        (
            "tube_task.standoff=0.03",
            "tube_task.standoff=0.03 m: expected >= instrument.gap",
        ),
        ("robot.p_WP=[0.0, 0.0, 0.05]", "0.03 to 0.2 m inside the trocar"),
        ("robot.p_WP=[0.2, 0.0, -0.06]", "40 deg at most off its vertical"),
        ("entry.p_WE=[0.0, 0.0, 0.0]", "m from the trocar, not 0.000"),
        ("entry.p_WE=[0.0, 0.0, 0.1]", "not 180; no trocar at this height"),
        ("sensor_zero.period=0.01", "sensor_zero.period"),
        ("joints.roll=9", "joints.roll=9.0 rad: expected >= 0 and <= 4"),
        ("joints.period=0.01", "expected joints.period=0.01 s, shared by both"),
        ("organ_motion.recording=nowhere.csv", "nowhere.csv"),
        (
            "task=resect organ_motion.lag=0.5",
            "operation.clearance=0.00015 m: expected >= .* tilt the tube by .* deg",
        ),
        (
            "task=resect organ_motion.breathing=[0.03, 0.0, 0.0]",
            "tilt the tube by 20.5 deg, which the snake cannot make up for",
        ),
        (
            "task=resect operation.clearance=5e-05",
            "phases.deviation=0.00015 m: expected <= operation.clearance=5e-05",
        ),
    ],
)
def test_bad_input(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("keyhole_circle", re.split(r" (?=[a-z_]+\.)", override))
