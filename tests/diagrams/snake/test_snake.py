"""The moving snake end to end: short runs of its scenarios."""

import math

import numpy as np
import pytest

from diagrams.common.run import run_scenario, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.snake.plots import plots
from diagrams.studies import load_scenario
from tests import runs


def test_circle():
    run = simulate(load_scenario("snake_circle", duration=5.0))
    assert not run.error
    figures = run.metrics
    assert figures["rms_pose_error"] <= 0.2e-3
    assert figures["max_axis_error"] <= math.radians(0.5)
    assert figures["max_coupler_error"] <= 1e-5
    assert figures["min_tension"] == pytest.approx(1.0)
    assert figures["max_tension"] < 20.0
    assert figures["false_alarms"] == figures["refused_poses"] == 0
    assert np.abs(run.wires.residual.modules).max() < 1e-9
    assert set(plots(run)) == {"path", "errors", "wires"}


def test_reach():
    run = runs.run("snake_reach")
    assert run.metrics["max_pose_error"] <= 1e-3
    assert run.metrics["refused_poses"] == run.metrics["false_alarms"] == 0
    assert (run.drums.limited.code == 0.0).all()


@pytest.fixture(scope="module")
def break_run():
    name = "snake_wire_break"
    return simulate(
        load_scenario(name, ["elastic.breaks=[{wire: 4, time: 1.01}]"], 1, 1.8)
    )


def test_a_broken_wire_is_noticed_and_motion_stops(break_run):
    figures = break_run.metrics
    assert not break_run.error
    assert figures["false_alarms"] == 0
    assert 0.0 < figures["break_detection_time"] <= 0.05
    alarm = break_run.watch.alarm
    assert alarm.module[-1] == 2.0
    after = break_run.signals["time"] > alarm.time[-1] + 0.02
    lengths = np.column_stack(break_run.drums.lengths)[after]
    assert np.abs(np.diff(lengths, axis=0)).max() == 0.0
    assert figures["min_tension"] > 0.5
    residual = np.abs(break_run.wires.residual.modules[:, 1])
    before = break_run.signals["time"] < 1.0
    assert residual[before].max() < 1e-6  # all wires taut: they agree
    assert residual[after].max() > 1e-3
    assert "break" in plots(break_run)


def test_elastic_wires_validate_the_drum_model(break_run):
    """Until the wire snaps both models hold the tip within a tenth of a millimetre.

    They differ by the drum model's stiffness (a module's own wires only) under the
    snake's weight.
    """
    drums = simulate(load_scenario("snake_circle", duration=1.0))
    elastic, stiff = (r.snake.tool.p[:50] for r in (break_run, drums))
    apart = np.linalg.norm(elastic - stiff, axis=1).max()
    assert 1e-6 < apart < 0.1e-3


@pytest.mark.study
def test_a_minute_without_false_alarm_then_a_broken_wire():
    run = simulate(load_scenario("snake_wire_break"))
    assert run.metrics["false_alarms"] == 0
    assert 0.0 < run.metrics["break_detection_time"] <= 0.05


@pytest.mark.parametrize("dead", range(9))
def test_any_wire_that_snaps_is_noticed(dead):
    breaks = [f"elastic.breaks=[{{wire: {dead}, time: 0.05}}]"]
    run = simulate(load_scenario("snake_wire_break", breaks, 1, 0.14))
    assert run.metrics["break_detection_time"] <= 0.05
    assert run.watch.alarm.module[-1] == dead // 3 + 1


def test_same_seed_same_result():
    one, two = (simulate(load_scenario("snake_circle", duration=0.3)) for _ in "12")
    for name in one.signals:
        np.testing.assert_array_equal(one.signals[name], two.signals[name])


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("wires=rubber", "wires='rubber': expected one of drums, elastic"),
        ("period=0.0", r"period=0.0 s: expected >= 0.001"),
        ("snake.half_pitch=0.0045", r"tan\(max_bend/2\)=0.4142 < R/\(2d\)=0.3750"),
        (
            "snake.max_bend=0.9",
            "max_bend=0.9 rad: expected >= 0.01 and <= 0.785",
        ),
        ("tip.circle.radius=0.05", "stopped by .*nearest reachable position"),
        ("tip.circle.p_WC=[0, 0, 0.3]", "stopped by s_max"),
        ("tip.circle.lean=1.7", "stopped by beta3"),
        ("snake.tool_radius=1e300", r"snake.tool_radius=1e\+300 m: expected"),
        ("period=1e-12", "period=1e-12 s: expected"),
        ("tip.dwell=1e12", "tip.dwell=1000000000000.0 s: expected"),
        ("duration=1e12", "duration=1000000000000.0 s: expected"),
        ("drive.kd=1.0", "drive.kd=1.0 N m s/rad: expected at most 0.1 s"),
        ("elastic.breaks=[{wire: 1, time: 0.5}]", "none but of wires='elastic'"),
        ("drive.kp=-1.0", "drive.kp=-1.0 N m/rad: expected >= 0.01"),
    ],
)
def test_bad_input_is_refused_before_anything_runs(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("snake_circle", [override])


@pytest.mark.browser
def test_replay_shows_the_snake(tmp_path, screenshot):
    run_scenario(load_scenario("snake_circle", duration=1.0), tmp_path)
    assert {p.name for p in tmp_path.iterdir()} >= {
        "metrics.json",
        "signals.csv",
        "scenario.yaml",
        "replay.html",
        "path.png",
        "errors.png",
        "wires.png",
    }
    from matplotlib.image import imread

    picture = imread(screenshot(tmp_path / "replay.html"))[..., :3]
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    assert ((red > 0.4) & (green < 0.3) & (blue < 0.3)).sum() > 50  # module 1's wires
    assert ((blue > 0.4) & (red < 0.3)).sum() > 50  # module 3's wires
    assert ((red > blue + 0.15) & (green > blue + 0.1)).sum() > 300  # brass balls


def test_free_balls_on_an_elastic_core_stay_and_leave_a_gap():
    run = runs.run("snake_statics")
    figures = run.metrics
    assert figures["buckled_at"] is None and figures["false_alarms"] == 0
    assert figures["least_eigenvalue"] > 0.005
    assert figures["max_split"] > math.radians(1.0)
    assert figures["min_tension"] > 0.5
    time, tool = run.signals["time"], run.snake.tool.p
    off = np.linalg.norm(tool - run.tip.reference.p, axis=1)
    assert off[time < 5.0].max() < 0.2e-3 < 0.4e-3 < off[-1]
    assert set(plots(run)) == {"path", "errors", "wires", "statics"}


def test_wires_alone_buckle_and_motion_stops():
    run = runs.run("snake_unstable")
    assert run.metrics["buckled_at"] <= 0.02
    assert run.metrics["least_eigenvalue"] < 0.0
    assert run.metrics["max_split"] > math.radians(30.0)
    assert run.metrics["false_alarms"] == 0
    after = run.signals["time"] > 0.05
    lengths = np.column_stack(run.drums.lengths)[after]
    assert np.abs(np.diff(lengths, axis=0)).max() == 0.0


def test_coupled_pairs_are_the_papers_snake():
    run = simulate(load_scenario("snake_statics", ["core.kind=coupled"], 1, 2.0))
    assert run.metrics["max_split"] < 1e-6
    assert run.metrics["rms_pose_error"] < 0.02e-3
    assert run.metrics["buckled_at"] is None


@pytest.mark.parametrize(
    "override",
    [
        "load.force=[0.1,0,0]",
        "load.cutting=0.1",
        "friction.wire=0.1",
        "compensation=model",
        "estimate=true",
        "control_pretension=true",
        "feel=true",
    ],
)
def test_what_a_wire_model_does_not_know_is_refused(override):
    key = override.split("=")[0].removesuffix(".wire")
    with pytest.raises(ScenarioError, match=rf"{key}.*without wires='statics'"):
        load_scenario("snake_circle", [override])


def test_a_model_and_a_tracked_tool_help_a_snake_that_cuts():
    helped, alone = (
        simulate(load_scenario("snake_cut", [f"compensation={kind}"], 1, 2.5)).metrics
        for kind in ("tracked", "none")
    )
    assert helped["rms_tool_error"] < 0.4e-3 < 0.5 * alone["rms_tool_error"]
    assert helped["max_tool_error"] < 1.5e-3
    assert helped["stops"] == 0 and helped["buckled_at"] is None
    assert helped["min_tension"] == pytest.approx(0.3)


def test_what_is_sensed_bounds_the_tips_and_feels_a_touch():
    touched = "load={force: [0.2, 0, 0], start: 1.5, end: 1.52}"
    keys = ["estimate=true", "feel=true", "compensation=model", touched]
    figures = simulate(load_scenario("snake_cut", keys, 1, 2.0)).metrics
    assert figures["tension_inside"] == 1.0
    assert 1.5 < figures["contact_at"] < 1.7
    assert figures["false_contacts"] == 0


def test_a_reversal_leaves_a_loop_with_friction_alone():
    short = ["tip.circle={period: 2.0, ramp: 0.1}", "tip.swing.bends=[0.3, 0.3, 0.3]"]
    rough, smooth = (
        simulate(load_scenario("snake_reversal", [*short, *more], 1, 2.7))
        for more in ([], ["friction={}"])
    )
    assert rough.metrics["loop_width"] > 0.3e-3
    assert smooth.metrics["loop_width"] < 0.1e-3
    assert "loop" in plots(rough)
