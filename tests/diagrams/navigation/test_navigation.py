"""The six navigation scenarios must show what the thesis promises, in the full loop."""

import json

import numpy as np
import pytest

from diagrams.common.plots import png
from diagrams.common.run import Run, run_scenario, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.navigation.figures import thesis_figures
from diagrams.navigation.perceived import grids
from diagrams.navigation.plots import plots
from diagrams.navigation.scenario import outruns
from diagrams.studies import load_scenario
from plants.crowd.signals import CAPACITY
from plants.turtlebot.signals import RobotState
from systems.perception.grid import OCCUPIED
from systems.switching.switching_state import MODES
from tests.runs import run

NAMES = (
    *("one_static", "one_moving", "local_minimum", "three_moving", "u_trap", "crowd"),
    *("lidar_crowd", "corner", "corridor", "recorded"),
)
KEYS = {
    *("reached", "collided", "time_to_target", "min_clearance", "path_ratio"),
    *("planner_step_median", "mode_switches", "real_time_factor"),
}


def modes(r: Run) -> set[str]:
    """The planner's states in a run."""
    return {MODES[int(m)] for m in np.round(r.planner.mode.state)}


@pytest.mark.parametrize("name", NAMES)
def test_every_scenario_arrives_without_collision(name):
    figures = run(f"nav_{name}").metrics
    assert set(figures) >= KEYS
    assert figures["reached"] and not figures["collided"]
    assert figures["min_clearance"] > 0.04
    assert figures["mode_switches"] >= 2
    json.dumps(figures, allow_nan=False)


def test_the_local_minimum_stops_the_classical_method_alone():
    classical = run("nav_local_minimum", "planner=classical")
    assert not classical.metrics["reached"] and not classical.metrics["collided"]
    robot = classical.robot.state
    # It trembles about the zero of the sum, 0.43 m before the gap, and stays there.
    place = np.column_stack([robot.x, robot.y])[-100:]
    assert np.abs(place - (5.0, 4.572)).max() < 0.05
    assert np.ptp(place, axis=0).max() < 0.1
    assert run("nav_local_minimum").metrics["reached"]


def test_the_trap_is_left_round_its_group():
    assert {"group", "leave", "attractive"} <= modes(run("nav_u_trap"))
    assert not run("nav_u_trap", "planner=classical").metrics["reached"]


def test_limits_of_the_robot_hold():
    r = run("nav_u_trap")
    robot = r.robot.state
    v, omega = robot.v, robot.omega
    assert np.abs(v).max() < 0.5 + 1e-6 and np.abs(omega).max() < 1.8 + 1e-6
    period = r.study.log_period
    assert np.abs(np.diff(v)).max() < 1.0 * period + 1e-6
    assert np.abs(np.diff(omega)).max() < 3.5 * period + 1e-6


def test_the_statechart_passes_one_standing_obstacle():
    r = run("nav_one_static", "planner=statechart")
    assert r.metrics["reached"]
    states = np.round(r.planner.mode.state).astype(int).tolist()
    assert list(dict.fromkeys(states)) == [0, 1, 2] and states[-1] == 0


def test_noise_is_repeatable_and_survived():
    noise = ("perception.position_noise=0.02", "perception.velocity_noise=0.05")
    first = run("nav_three_moving", *noise)
    again = simulate(load_scenario("nav_three_moving", list(noise)))
    assert first.metrics["reached"]
    for name, column in first.signals.items():
        np.testing.assert_array_equal(column, again.signals[name])


def test_the_gap_is_passed_with_noise():
    noise = ("perception.position_noise=0.01", "perception.velocity_noise=0.05")
    r = run("nav_local_minimum", *noise)
    assert r.metrics["reached"] and not r.metrics["collided"]


def test_a_faster_obstacle_is_told_and_the_robot_does_its_best():
    scenario = load_scenario("nav_one_moving")
    scenario.obstacles[0].velocity = [0.0, -0.8]
    scenario.obstacles[0].start = [4.0, 6.4]
    assert outruns(scenario) == [0]
    figures = simulate(scenario).metrics
    assert figures["faster_obstacles"] == [0] and figures["outrun_time"] > 0.0
    assert figures["reached"]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["goal=[4.0, 0.3]"], r"goal=.* centre of obstacles\[0\], which stands"),
        (["start=[3.4, 0.1]"], r"start=.* outside the safety circle of obstacles\[0\]"),
        (
            ["perception.vision=0.6"],
            r"perception.vision=0.6 m: expected > .*hit before it is seen",
        ),
        (["perception.vision=0.3"], r"perception.vision=0.3 m: expected > 0.38, robot"),
        (["goal=[.nan, 0.0]"], r"finite"),
        (
            ["goal=[0.0, 0.0]"],
            r"goal=.*: expected it more than reach=.* m from the start, not 0",
        ),
        (["goal=[1000.0, 0.0]"], r"goal=.* m: expected 2 numbers .* <= 100"),
        (["start=[0.0]"], r"start=\[0.0\] m: expected 2"),
        (["planner=magic"], r"planner='magic': expected one of switching"),
        (["compare=[classic]"], r"compare=\['classic'\]: expected one of"),
        (["robot.radius=0.0"], r"robot.radius=0.0 m: expected >= 0.05"),
        (["reach=0.0"], r"reach=0.0 m: expected >= 0.01"),
        (
            ["switching.deceleration=1000.0"],
            r"switching.deceleration=.* m/s\^2: expected",
        ),
        (["crowd.people=3"], r"none together with others"),
        (["switching.margin=[0.1]"], r"did you mean 'margins'|switching.margin"),
    ],
)
def test_bad_input_is_refused(overrides, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("nav_one_static", overrides)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["start=[0.0, 1.05]"],
            r"start=.*: expected it 0.171 m from the walls .*, not 0.05",
        ),
        (["goal=[8.0, -1.0]"], r"goal=.* as the robot sees them, not 0.1"),
        (
            ["goal=[30.0, 0.0]", "mapping.x=4"],
            r"goal=.*: expected it on the grid, 20 m wide",
        ),
        (
            ["walls=[{solid: true, points: [[5, 5], [6, 5], [6, 6], [5, 6]]}]"],
            r"walls\[0\].points=.*: expected an outline .*; it is 1 m",
        ),
        (["senses=given"], r"walls: expected senses=lidar"),
        (["robot.model=turtlebot5"], r"robot.model='turtlebot5': expected one of"),
        (["recording=nobody.txt"], r"recording"),
    ],
)
def test_bad_worlds_of_walls_are_refused(overrides, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("nav_corner", overrides)


def test_corners_are_passed_slower_than_if_nobody_could_step_out():
    before = []
    for more in ([], ["switching.unseen_speed=0"]):
        robot = run("nav_corner", "obstacles=[]", *more).robot.state  # nobody does
        before.append(robot.v[(robot.x > 2.0) & (robot.x < 2.9)].mean())
    assert before[0] < 0.65 * before[1]


def test_what_the_robot_believes_is_near_what_is_true():
    for name in ("lidar_crowd", "corner", "recorded"):
        figures = run(f"nav_{name}").metrics
        assert figures["goal_miss"] < 0.2 and figures["max_place_error"] < 0.1
        assert figures["place_within_3_sigma"] > 0.95
        assert figures["walkers_tracked"] > 0.8
        assert figures["median_track_error"] < 0.06
    r = run("nav_corner")
    *_, (last, grid) = grids(r)
    assert last == pytest.approx(30.0)
    # The wall is in the grid where it is in the world, also where it is out of sight.
    stands = grid.odds >= OCCUPIED
    below = stands & (np.abs(grid.y + 1.1) < 0.1) & (grid.x > 0.0) & (grid.x < 8.0)
    assert below.sum() > 30
    png(plots(r)["perception"])


def test_negative_radius_is_refused():
    scenario = load_scenario("nav_three_moving")
    scenario.obstacles[2].radius = -0.5
    with pytest.raises(ScenarioError, match=r"obstacles\[2\].radius=-0.5 m: expected"):
        simulate(scenario)


def test_a_world_without_obstacles_has_no_clearance():
    r = run("nav_one_static", "obstacles=[]", "compare=[]")
    assert r.metrics["reached"] and r.metrics["min_clearance"] is None
    assert r.metrics["path_ratio"] == pytest.approx(1.0, abs=0.02)
    assert not r.obstacles.rows.radius.any()
    for figure in plots(r).values():
        png(figure)


def test_signals_have_the_names_of_their_declarations():
    r = run("nav_one_static")
    assert list(r.signals)[1:6] == [f"robot.state.{n}" for n in RobotState._fields]
    assert list(r.signals)[6] == "obstacles.rows.x_0"
    obstacles, robot = r.obstacles.rows, r.robot.state
    assert obstacles.x.shape == (*robot.x.shape, CAPACITY)
    np.testing.assert_array_equal(obstacles.radius[:, 0], 0.5)
    np.testing.assert_array_equal(robot.theta, r.signals["robot.state.theta"])


def test_plots_of_two_methods_and_of_the_thesis():
    figures = plots(run("nav_local_minimum", "compare=[classical]"))
    drawn = {"path", "motion", "potential", "field_along", "figure_04", "figure_07"}
    assert drawn | {"notes_two_cases", "switching_step"} <= set(figures)
    assert "figure_12" not in figures  # the thesis's is empty
    texts = [text.get_text() for text in figures["notes_two_cases"].axes[0].texts]
    for name in ("case 1", "case 2", "P1", "P2", "x_Omega", "O, c ="):
        assert any(text.startswith(name) for text in texts), name
    labels = [text.get_text() for text in figures["path"].legends[0].get_texts()]
    assert labels[0].startswith("switching: arrives")
    assert labels[1] == "classical: does not arrive"
    assert len(thesis_figures()) == 12


def test_results_with_a_replay(tmp_path):
    result = run_scenario(load_scenario("nav_one_static", duration=2.0), tmp_path)
    assert not result.error
    for name in ("replay.html", "path.png", "motion.png", "metrics.json"):
        assert (tmp_path / name).stat().st_size > 100


@pytest.mark.browser
def test_replay_shows_the_robot(tmp_path, screenshot):
    from matplotlib.image import imread

    run_scenario(load_scenario("nav_one_static", duration=4.0), tmp_path)
    picture = imread(screenshot(tmp_path / "replay.html"))[..., :3]
    red = (picture[..., 0] > 0.5) & (picture[..., 1] < 0.35) & (picture[..., 2] < 0.35)
    assert red.sum() > 200  # the obstacle
