"""The tools are a list: names reach them, roles wire them, three obstacles are YAML."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.common.results import results, save_scenario
from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.gauze.tools import gap, hands
from diagrams.studies import check_scenario, load_scenario

MORE = (
    "tools=[{name: second, role: obstacle, p_WG: [-0.08, 0.06, 0.0],"
    " points: [[-0.055, 0.035, -0.1]]},"
    " {name: third, role: obstacle, p_WG: [0.03, -0.11, 0.0],"
    " points: [[0.03, -0.07, -0.09]]}]"
)


def test_keys_reach_a_tool_by_its_name(tmp_path):
    scenario = load_scenario(
        "gauze_static",
        ["obstacle.points=[[0.0, 0.05, -0.1]]", "camera.p_WG=[0.13, 0.12, 0.0]"],
    )
    assert scenario.obstacles[0].points == [[0.0, 0.05, -0.1]]
    assert scenario.camera.p_WG == [0.13, 0.12, 0.0]
    hunted = load_scenario("gauze_static", ["hunt.speed=0.01", "hunt.end=5"])
    assert hunted.obstacles[0].hunt.speed == 0.01
    with results(tmp_path) as into:
        again = load_scenario(str(save_scenario(hunted, into)))
    assert again.tools == hunted.tools


def test_three_obstacles_need_no_code():
    scenario = load_scenario("gauze_static", [MORE], duration=1.0)
    assert [tool.name for tool in scenario.obstacles] == ["obstacle", "second", "third"]
    run = simulate(scenario)
    assert not run.error
    columns = [name for name in run.signals if name.startswith("clearance")]
    assert columns == [
        *(f"clearance.{name}" for name in ("obstacle", "second", "third")),
        *("clearance.target", "clearance.camera"),
    ]
    assert run.second.shaft.tip[0] == pytest.approx([-0.055, 0.035, -0.1], abs=1e-3)
    np.testing.assert_array_equal(
        gap(run, "obstacle"), run.clearance.distance[:, :3].min(axis=1)
    )
    assert run.metrics["min_tool_clearance"] == gap(run, "obstacle").min()
    assert run.third.estimate.known[-1] == 1.0


def test_tremors_differ_and_do_not_meet_another_seed():
    scenario = load_scenario("gauze_static", [MORE])
    seeds = {
        tool.tremor_seed
        for seed in range(50)
        for tool in hands(scenario.tools, seed).values()
    }
    assert len(seeds) == 50 * 4


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("obstacle.pints=[[0, 0, -0.1]]", r"obstacle.pints.*did you mean 'points'"),
        ("obstacle.points=[[0, 0]]", r"obstacle.points=.*expected"),
        ("tools=[{role: obstacle}]", r"tools.*with a name"),
        ("tools=[{name: x, role: hand}]", r"role='hand'"),
        ("camera.role=[]", r"role=\[\]: choose from"),
        (
            "tools=[{name: s, role: target, p_WG: [0.2, 0.2, 0]}]",
            r"one of role 'target'",
        ),
        (
            "obstacle.p_WG=[0.0, 0.0, 0.0]",
            r"0.02 m apart, robot.p_WG and obstacle.p_WG are",
        ),
        ("obstacle=3", r"obstacle=3: expected keys"),
    ],
)
def test_bad_tools_are_told(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("gauze_static", [override])


def test_without_an_obstacle_it_is_refused_clearly():
    scenario = load_scenario("gauze_static")
    tools = [tool for tool in scenario.tools if tool.name != "obstacle"]
    with pytest.raises(ScenarioError, match="expected one of role 'obstacle'"):
        check_scenario(replace(scenario, tools=tools))
