"""Several obstacle tools: the nearest counts, and none that is lost is passed over."""

from math import nan

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from diagrams.gauze.kinematic_loop import estimate
from systems.auto_guidance.backward_movement import BackwardMovement
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiter
from systems.auto_guidance.go_to_target import GoToTarget, guide_point
from systems.auto_guidance.nearest import nearest_obstacle, obstacle_at
from systems.auto_guidance.velocity_corrections import VelocityCorrections
from systems.common.geometry import closest_points
from systems.common.signal import example, flat, vector, view
from systems.common.signals import Guide, RobotTool

NAMES = ("left", "right", "behind")
BEHAVIOURS = (GoToTarget, VelocityCorrections, BackwardMovement, FuzzyArbiter)
ROBOT = RobotTool((0.0, 0.0, 0.0), (-0.02, 0.0, -0.12))
TARGET = estimate((0.05, 0.0, -0.1), (0.1, 0.03, 0.0))
LEFT = estimate((0.0, 0.02, -0.12), (0.0, 0.1, 0.0), (0.0, -0.05, 0.0))
RIGHT = estimate((0.0, -0.04, -0.12), (0.0, -0.1, 0.0), (0.0, 0.05, 0.0))
BEHIND = estimate((-0.08, 0.0, -0.1), (-0.1, 0.0, 0.0))
THREE = (LEFT, RIGHT, BEHIND)
LOST = {"lost": LEFT._replace(known=0.0), "nan": LEFT._replace(v=(nan, 0.0, 0.0))}


def rows(tools):
    """Estimates as the port has them, one a row."""
    return np.array([flat(tool) for tool in tools])


def drawn(rng):
    """A robot's tool and three others, anywhere."""
    ends = rng.uniform(-0.1, 0.1, (4, 2, 3))
    robot = RobotTool(*map(vector, ends[0]))
    return robot, [estimate(*pair) for pair in ends[1:]]


def distance(robot, tool):
    """Of the axes, m."""
    return closest_points(robot.fulcrum, robot.tip, tool.fulcrum, tool.p).distance


def test_the_least_distance_of_the_axes_tells_and_the_guide_tells_the_same():
    rng = np.random.default_rng(1)
    for _ in range(300):
        robot, tools = drawn(rng)
        nearest = min(tools, key=lambda tool: distance(robot, tool))
        assert nearest_obstacle(robot, rows(tools)) == nearest
        guide = guide_point(robot, nearest, TARGET.p, 0.1)
        assert obstacle_at(guide, rows(tools)) == nearest


def test_of_one_that_one_whatever_it_is():
    nowhere = RobotTool((nan, 0.0, 0.0), (0.0, 0.0, -0.1))
    for tool in (LEFT, LOST["lost"]):
        assert nearest_obstacle(nowhere, rows([tool])) == tool
        assert obstacle_at(example(Guide), rows([tool])) == tool


@pytest.mark.parametrize("place", range(3))
def test_one_that_is_lost_comes_first(place):
    tools = [LEFT, RIGHT, BEHIND]
    tools[place] = BEHIND._replace(known=0.0)
    assert nearest_obstacle(ROBOT, rows(tools)) == tools[place]
    assert obstacle_at(example(Guide), rows(tools)) == tools[place]


def block(kind, tools, guide):
    """A behaviour among obstacles: the block, and its context after an update."""
    dut = kind(obstacles=NAMES[: len(tools)])
    context = dut.CreateDefaultContext()
    inputs = {
        "v1": (0.05, 0.0, 0.0),
        "v2": (-0.01, 0.0, 0.0),
        "v3": (0.0, -0.02, 0.0),
        "guide": flat(guide),
        "robot_tool": flat(ROBOT),
        "obstacles": rows(tools).ravel(),
        "target": flat(TARGET),
    }
    for name in map(dut.get_input_port, range(dut.num_input_ports())):
        name.FixValue(context, inputs[name.get_name()])
    Simulator(dut, context).AdvanceTo(0.5 / 60.0)
    return dut, context


def outputs(kind, tools, guide):
    """All that a behaviour emits."""
    dut, context = block(kind, tools, guide)
    ports = map(dut.get_output_port, range(dut.num_output_ports()))
    return np.concatenate([port.Eval(context) for port in ports])


@pytest.mark.parametrize("kind", BEHAVIOURS, ids=lambda kind: kind.__name__)
def test_a_behaviour_among_three_is_that_with_the_nearest_alone(kind):
    guide = guide_point(ROBOT, LEFT, TARGET.p, 0.1)
    alone = outputs(kind, [LEFT], guide)
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        tools = [THREE[i] for i in order]
        np.testing.assert_array_equal(outputs(kind, tools, guide), alone)
    other = guide_point(ROBOT, RIGHT, TARGET.p, 0.1)
    assert np.any(outputs(kind, [RIGHT], other) != alone)


def test_one_that_comes_nearer_takes_the_guide():
    tools = list(THREE)
    for near, y in ((LEFT, -0.04), (None, -0.015)):
        tools[1] = RIGHT._replace(p=(0.0, y, -0.12))
        dut, context = block(GoToTarget, tools, example(Guide))
        guide = view(Guide, dut.GetOutputPort("guide").Eval(context))
        expected = guide_point(ROBOT, near or tools[1], TARGET.p, 0.1)
        np.testing.assert_allclose(flat(guide), flat(expected), atol=1e-15)


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("kind", BEHAVIOURS, ids=lambda kind: kind.__name__)
def test_a_behaviour_comes_to_rest_when_one_of_three_is_lost(kind, lost, place):
    guide = guide_point(ROBOT, LEFT, TARGET.p, 0.1)
    dut, context = block(kind, THREE, guide)
    moving = dut.get_output_port(dut.num_output_ports() - 1).Eval(context)
    assert np.any(moving)
    tools = list(THREE)
    tools[place] = LOST[lost]
    dut.GetInputPort("obstacles").FixValue(context, rows(tools).ravel())
    Simulator(dut, context).AdvanceTo(1.0)
    port = {GoToTarget: "v1", VelocityCorrections: "v2", BackwardMovement: "v3"}
    v = dut.GetOutputPort(port.get(kind, "v_R")).Eval(context)
    np.testing.assert_allclose(v, 0.0, atol=1e-9)
