"""The bypass as a whole: kinematic scenes, waiting, several tools, the block."""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
import pytest

from diagrams.gauze.kinematic_loop import estimate, run
from diagrams.gauze.kinematic_planners import BYPASS, CLEARANCE, NO_CONE, ROBOT, ROOM
from diagrams.gauze.scenes import CONTACT, scene
from systems.bypass.bypass_route import OVER, STRAIGHT, choose_way
from systems.bypass.clearance_constraint import ClearanceConstraint
from systems.bypass.obstacle_tools import Margins
from systems.bypass.shadow_body import ObstacleTool, pose_distance, read_tool
from systems.bypass.tool_bypass import (
    State,
    ToolBypass,
    ToolBypassParams,
    Way,
    constants,
)
from systems.bypass.workspace import WorkspaceParams
from systems.common import geometry
from systems.common.reach_limits import ReachLimits
from systems.common.signal import example, flat, size, view
from systems.common.signals import Estimate, Guide, RobotTool

G = (0.0, 0.0, 0.0)
RECORD = constants(ToolBypassParams())[0]


def tools(*pairs) -> np.ndarray:
    """Obstacle tools at rest from (fulcrum, tip) pairs."""
    still = (0.0, 0.0, 0.0)
    return np.array(
        [flat(ObstacleTool(tip, still, a, 0.007, 0.0095)) for a, tip in pairs]
    )


def chosen(p, goal, rows, edge=STRAIGHT, waits=0):
    """The way at one instant, in a workspace without borders."""
    return choose_way(RECORD, ROOM, NO_CONE, G, p, goal, rows, edge, waits)


def test_a_free_way_is_straight_and_a_crossed_one_goes_over_an_edge():
    p, goal = (-0.05, 0.0, -0.06), (0.05, 0.0, -0.06)
    aside = tools(((0.0, 0.1, 0.0), (0.0, 0.05, -0.05)))
    way = chosen(p, goal, aside)
    assert (way.edge, way.waits, way.aim) == (STRAIGHT, 0, goal)
    assert way.direction == pytest.approx((1.0, 0.0, 0.0))
    assert way.length == pytest.approx(0.1)
    across = tools(((0.0, 0.1, 0.0), (0.0, -0.03, -0.055)))
    way = chosen(p, goal, across)
    assert way.edge in (1, 2) and not way.waits and way.length > 0.1


def test_the_edge_in_use_is_kept_until_another_is_clearly_shorter():
    p, goal = (-0.05, 0.0, -0.06), (0.05, 0.0, -0.06)
    across = tools(((0.0, 0.1, 0.0), (0.0, -0.012, -0.055)))
    best = chosen(p, goal, across)
    first, other = best.edge, 3 - best.edge
    lengths = {first: best.length}
    kept = chosen(p, goal, across, edge=other)
    lengths[kept.edge] = kept.length
    if kept.edge == other:
        assert lengths[first] > 0.85 * lengths[other] - 0.005
    else:
        assert lengths[first] < lengths[first] / 0.85


def test_where_no_edge_will_do_it_retracts_turns_and_inserts():
    """A grid of tools that leaves room only near the fulcrum."""
    p, goal = (-0.08, 0.0, -0.1), (0.08, 0.0, -0.1)
    fence = tools(
        ((0.0, 0.15, -0.01), (0.0, -0.12, -0.055)),
        ((0.008, -0.15, -0.01), (0.008, 0.12, -0.058)),
        ((-0.008, -0.15, -0.02), (-0.008, 0.12, -0.062)),
    )
    edge, waits, met = STRAIGHT, 0, set()
    for _ in range(4000):
        direction, length, edge, waits, _ = chosen(p, goal, fence, edge, waits)
        met.add(edge)
        if length < 1e-3:
            break
        p = geometry.along(p, min(1e-4, length), direction)
        assert min(pose_distance(read_tool(row), G, p) for row in fence) > 0.0065
    assert geometry.norm(geometry.sub(p, goal)) < 2e-3
    assert not waits and met - {STRAIGHT}


def test_it_waits_at_a_free_pose_near_the_target():
    for number in range(30):
        given = scene("blocked", 2, number)
        a, tip = given.p_WGo, given.legs[0].p0
        row = tools((a, tip))
        way = choose_way(
            RECORD,
            ROOM,
            NO_CONE,
            given.p_WGr,
            given.p_WPr,
            given.p_WPs,
            row,
            STRAIGHT,
            0,
        )
        assert way.waits
        assert pose_distance(read_tool(row[0]), given.p_WGr, way.aim) > 0.0075
        # No free pose is much nearer to the target: 28 mm is the price of the detours.
        rng = np.random.default_rng(number)
        poses = np.array(given.p_WPs) + rng.uniform(-0.08, 0.08, (4000, 3))
        free = [
            float(np.linalg.norm(x - given.p_WPs))
            for x in poses
            if pose_distance(read_tool(row[0]), given.p_WGr, tuple(x)) > 0.008
            and x[2] > -0.065
        ]
        gap = geometry.norm(geometry.sub(way.aim, given.p_WPs))
        assert gap < min(free) + 0.03


def fixed(dut):
    """A context with the examples at the inputs."""
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    return context


def tip_speed(dut, context):
    """That v_1 means for R's tip."""
    guide = view(Guide, dut.GetOutputPort("guide").Eval(context))
    return np.linalg.norm(dut.GetOutputPort("v1").Eval(context)) / guide.s


def test_the_block_runs_down_while_a_tool_is_lost():
    dut = ToolBypass()
    context = fixed(dut)
    state = context.get_mutable_discrete_state_vector()
    state.SetFromVector(flat(State((0.05, 0.0, 0.0), -1.0 / 60.0, 0.0, 0.0, 0.0)))
    lost = example(Estimate)._replace(known=0.0)
    dut.GetInputPort("obstacles").FixValue(context, flat(lost))
    assert tip_speed(dut, context) == pytest.approx(0.05 - 1.0 / 60.0, abs=1e-9)
    dut.GetInputPort("obstacles").FixValue(context, np.full(size(Estimate), np.nan))
    for name in ("v1", "guide", "way"):
        assert np.isfinite(dut.GetOutputPort(name).Eval(context)).all()


@pytest.mark.parametrize("place", range(3))
def test_the_block_runs_down_while_one_of_three_is_lost(place):
    dut = ToolBypass(obstacles=("a", "b", "c"))
    context = fixed(dut)
    state = context.get_mutable_discrete_state_vector()
    state.SetFromVector(flat(State((0.05, 0.0, 0.0), -1.0 / 60.0, 0.0, 0.0, 0.0)))
    for bad in ({"known": 0.0}, {"p": (np.nan, 0.0, 0.0)}):
        obstacles = [example(Estimate)] * 3
        obstacles[place] = obstacles[place]._replace(**bad)
        dut.GetInputPort("obstacles").FixValue(context, flat(tuple(obstacles)))
        assert tip_speed(dut, context) == pytest.approx(0.05 - 1.0 / 60.0, abs=1e-9)
        assert np.isfinite(dut.GetOutputPort("guide").Eval(context)).all()


class Blocks:
    """The bypass and the constraint behind it as blocks, for the kinematic loop."""

    def __init__(self, names):
        margins = Margins(avoid_target=False, avoid_camera=False)
        reach = ReachLimits(
            min_insertion=ROBOT.least_insertion, max_insertion=0.5, max_tilt=3.1
        )
        around = (margins, reach, WorkspaceParams(floor=-0.065), names)
        builder = DiagramBuilder()
        first = builder.AddSystem(ToolBypass(BYPASS, *around))
        second = builder.AddSystem(ClearanceConstraint(CLEARANCE, *around))
        for output, port in (("v1", "v_R"), ("guide", "guide")):
            builder.Connect(first.GetOutputPort(output), second.GetInputPort(port))
        for name in ("robot_tool", "obstacles", "target", "camera", "view_cone"):
            builder.ExportInput(first.GetInputPort(name), name)
            builder.ConnectInput(name, second.GetInputPort(name))
        for block, name in ((first, "guide"), (first, "way"), (second, "v_safe")):
            builder.ExportOutput(block.GetOutputPort(name), name)
        self.diagram = builder.Build()
        self.simulator, self.ways = Simulator(self.diagram), set()

    def step(self, dt, robot, obstacle, target, others=()):
        """The velocity of the robot's tip, see `Planner`."""
        context = self.simulator.get_mutable_context()
        for name, value in {
            "robot_tool": robot,
            "obstacles": (obstacle, *others),
            "target": target,
            "camera": target,
            "view_cone": NO_CONE,
        }.items():
            self.diagram.GetInputPort(name).FixValue(context, flat(value))
        out = {
            name: np.array(self.diagram.GetOutputPort(name).Eval(context))
            for name in ("guide", "way", "v_safe")
        }
        self.ways.add(int(view(Way, out["way"]).way))
        self.simulator.AdvanceTo(context.get_time() + dt)
        return tuple(out["v_safe"] / view(Guide, out["guide"]).s)


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_the_blocks_pass_two_and_three_tools_that_stand(number):
    given = scene("crowded", 5, number)
    count = 1 + len(given.others)
    assert count == 2 + number % 2
    planner = Blocks([f"obstacle_{i}" for i in range(count)])
    outcome = run(given, planner)
    assert outcome.reached and outcome.clearance > 0.0015
    assert planner.ways - {STRAIGHT}  # one was in its way


def test_edges_are_numbered_in_the_obstacles_order():
    tools = [
        estimate((0.0, -0.012, -0.055), (0.0, 0.1, 0.0)),  # across, the others aside
        estimate((0.0, 0.12, -0.08), (0.0, 0.15, 0.0)),
        estimate((0.0, -0.12, -0.08), (0.0, -0.15, 0.0)),
    ]
    robot = RobotTool(G, (-0.05, 0.0, -0.06))
    target = estimate((0.05, 0.0, -0.06), G)
    for place, order in enumerate(([0, 1, 2], [1, 0, 2], [1, 2, 0])):
        planner = Blocks(["a", "b", "c"])
        first, *others = [tools[i] for i in order]
        planner.step(1.0 / 60.0, robot, first, target, others)
        (way,) = planner.ways
        assert way in (2 * place + 1, 2 * place + 2)


def test_the_block_starts_off_with_bounded_acceleration():
    dut = ToolBypass()
    context = fixed(dut)
    assert 0.0 < tip_speed(dut, context) <= 1.0 / 60.0 + 1e-9


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match=r"tool_bypass.max_speed=nan m/s: .* > 0"):
        ToolBypass(ToolBypassParams(max_speed=float("nan")))
    with pytest.raises(ValueError, match=r"freed_room=0.0001 m: expected more than"):
        ToolBypass(ToolBypassParams(freed_room=0.0001))
    with pytest.raises(ValueError, match=r"switch_ratio=1.5: expected > 0 and <= 1"):
        ToolBypass(ToolBypassParams(switch_ratio=1.5))


def test_contact_is_five_millimetres():
    assert CONTACT == 0.005
    assert OVER < STRAIGHT
