"""Tests of the tool's navigation: fulcrum geometry, limits, stops."""

from dataclasses import fields
import math

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from systems.bypass.workspace import constants as workspace_constants
from systems.common.reach_limits import ReachLimits
from systems.common.signal import example, flat, view
from systems.common.signals import (
    ClearanceStatus,
    Estimate,
    Guide,
    Permission,
    RobotTool,
    ToolMotion,
    Velocity,
    ViewCone,
)
from systems.common.stops import Stop
from systems.motion.tool_navigation import (
    ToolNavigation,
    ToolNavigationParams,
    constants,
    limit_tip_velocity,
    reachable,
)

P_WG = (0.0, 0.0, 0.0)
WIDE_CONE = ViewCone((0.0, -0.05, 0.0), (0.0, 0.0, -1.0), 1.4)
TARGET = example(Estimate)._replace(p=(0.03, 0.0, -0.1))
LOST = TARGET._replace(known=0.0)
LOADED = Permission(0.0, float(Stop.WALL_LOADED))


def run(v_R, seconds=0.5, s=0.5, params=None, **changes):
    """Drives the block with constant inputs; the arm follows exactly.

    Returns its motion and the stop's codes after every update.
    """
    p_WP = (0.0, 0.0, -0.1)
    obstacles = changes.pop("obstacles", [example(Estimate)])
    names = [f"obstacle_{i}" for i in range(len(obstacles))]
    dut = ToolNavigation(params, p_WP, P_WG, names)
    context = dut.CreateDefaultContext()
    inputs = {
        "v_R": Velocity(tuple(v_R)),
        "guide": example(Guide)._replace(s=s),
        "obstacles": tuple(obstacles),
        "target": TARGET,
        "view_cone": WIDE_CONE,
    }
    for name, value in (inputs | changes).items():
        dut.GetInputPort(name).FixValue(context, flat(value))
    simulator = Simulator(dut, context)
    rows, codes = [flat(ToolMotion(p_WP, P_WG, P_WG, P_WG, 0.0))], []
    for k in range(int(seconds * 60)):
        robot = RobotTool(P_WG, tuple(view(ToolMotion, rows[-1]).tip))
        dut.GetInputPort("robot_tool").FixValue(context, flat(robot))
        simulator.AdvanceTo((k + 0.5) / 60)
        rows.append(np.array(dut.GetOutputPort("tool").Eval(context)))
        codes.append(dut.GetOutputPort("stop").Eval(context).item())
    return view(ToolMotion, np.array(rows[1:])), np.array(codes)


def lengths(vectors):
    """Of an array of vectors."""
    return np.linalg.norm(vectors, axis=-1)


def test_the_tip_moves_with_the_guide_points_velocity_over_s():
    tool, _ = run([0.01, 0.0, 0.0], s=0.5)
    np.testing.assert_allclose(tool.v[-1], [0.02, 0.0, 0.0], atol=1e-12)
    # The guide point lies at s times the tip, so it moves with v_R.
    velocity = 0.5 * (tool.tip[-1] - tool.tip[-2]) * 60
    np.testing.assert_allclose(velocity, [0.01, 0.0, 0.0], atol=1e-9)


def test_shaft_points_from_the_fulcrum_to_the_tip_and_turns_with_it():
    tool, _ = run([0.008, 0.005, 0.004])
    u = tool.tip / lengths(tool.tip)[:, None]
    np.testing.assert_allclose(tool.u, u, atol=1e-12)
    rate = np.gradient(u, 1 / 60, axis=0)
    np.testing.assert_allclose(tool.du[5:-1], rate[5:-1], atol=2e-3)


def test_speed_turning_and_acceleration_are_bounded():
    params = ToolNavigationParams(
        tip_speed=0.1, turning_speed=0.3, acceleration=0.5, max_insertion=0.15
    )
    tool, _ = run([1.0, 0.0, 0.2], 0.3, 1.0, params)
    assert lengths(tool.v).max() <= 0.1 + 1e-12
    assert lengths(tool.du).max() <= 0.3 + 1e-6
    assert lengths(np.diff(tool.v, axis=0)).max() * 60 <= 0.5 + 1e-9


@pytest.mark.parametrize(
    ("v_R", "limit"),
    [
        ([0.0, 0.0, -0.05], lambda p: np.linalg.norm(p) <= 0.12 + 1e-4),
        ([0.0, 0.0, 0.05], lambda p: np.linalg.norm(p) >= 0.08 - 1e-4),
        ([0.05, 0.0, 0.0], lambda p: math.atan2(p[0], -p[2]) <= 0.3 + 1e-3),
    ],
)
def test_borders_hold(v_R, limit):
    params = ToolNavigationParams(min_insertion=0.08, max_insertion=0.12, max_tilt=0.3)
    target = TARGET._replace(p=(0.0, 0.01, -0.1))
    tool, _ = run(v_R, 3.0, 1.0, params, target=target)
    assert all(limit(p) for p in tool.tip)
    # It reached the border: the limit was really met.
    assert lengths(tool.v[-1]) < 0.05


def test_gauze_stays_in_the_view_cone():
    cone = ViewCone(P_WG, (0.0, 0.0, -1.0), 0.35)
    tool, _ = run([0.03, 0.0, 0.0], 3.0, 1.0, view_cone=cone)
    x, y, z = tool.tip.T
    angle = np.arctan2(np.hypot(x, y), -z)
    assert angle.max() <= 0.35
    assert angle.max() > 0.3


@pytest.mark.parametrize(
    ("changes", "stop"),
    [
        ({}, Stop.MOVING),
        ({"target": TARGET._replace(known=0.0)}, Stop.TARGET_LOST),
        ({"obstacles": [TARGET._replace(known=0.0)]}, Stop.OBSTACLE_LOST),
        ({"obstacles": [TARGET._replace(sigma_p=1.0)]}, Stop.WAITING),
        ({"guide": example(Guide)._replace(rho=math.nan)}, Stop.NOT_A_NUMBER),
        ({"target": TARGET._replace(p=(0.0, 0.0, -0.5))}, Stop.OUT_OF_REACH),
        ({"target": TARGET._replace(p=(0.2, 0.0, -0.1))}, Stop.OUT_OF_REACH),
        ({"view_cone": ViewCone((0.1, 0.0, 0.0), (0, 0, -1), 0.3)}, Stop.OUT_OF_VIEW),
        ({"permission": Permission(0.0, 8.0)}, Stop.WALL_LOADED),
        ({"permission": Permission(0.0, 0.0)}, None),
        ({"permission": Permission(math.nan, 0.0)}, Stop.NOT_A_NUMBER),
        ({"permission": Permission(0.3, 0.0)}, Stop.MOVING),
    ],
)
def test_why_the_robot_stands(changes, stop):
    tool, codes = run([0.01, 0.0, 0.0], 0.5, **changes)
    assert codes[-1] == (stop or Stop.MOVING)
    speed = lengths(tool.v[-1])
    assert all(np.isfinite(part).all() for part in tool)
    assert (speed > 0.01) if stop == Stop.MOVING else speed == 0.0


@pytest.mark.parametrize(
    ("changes", "goes"),
    [
        ({}, True),
        ({"target": TARGET._replace(known=0.0)}, True),
        ({"permission": Permission(0.0, float(Stop.PROBING))}, True),
        ({"permission": LOADED}, False),
        ({"obstacles": [LOST]}, True),
        ({"obstacles": [LOST], "permission": LOADED}, False),
        ({"obstacles": [LOST._replace(sigma_p=1.0)]}, False),
    ],
)
def test_out_of_a_tools_way_it_is_faster_and_leaves_the_view(changes, goes):
    calm = ClearanceStatus(0, 1, 1, 0, 0, 0, 0, 0, 1, 1)
    hurry = calm._replace(escape=1)
    up = run([0.0, 0.0, 0.2], 0.25, 1.0, clearance=hurry, **changes)[0]
    assert (lengths(up.v).max() > 0.19) == goes
    up = run([0.0, 0.0, 0.2], 0.25, 1.0, clearance=calm, **changes)[0]
    assert lengths(up.v).max() <= 0.1
    cone = ViewCone(P_WG, (0.0, 0.0, -1.0), 0.2)
    inside = {"target": TARGET._replace(p=(0.0, 0.0, -0.1))} | changes
    for status, leaves in ((hurry, goes), (calm, False)):
        aside = run([0.05, 0, 0], 0.7, 1.0, view_cone=cone, clearance=status, **inside)[
            0
        ]
        assert (aside.tip[-1][0] > 0.025) == leaves


def test_the_wrist_moves_no_faster_than_it_can():
    """With little of the shaft inside, the other end of it goes a long way."""
    tool, _ = run([0.1, 0.0, 0.0], 0.4, 1.0)
    outside = 0.4 - lengths(tool.tip)
    assert (lengths(tool.du) * outside).max() <= 0.25 + 1e-3
    change = np.diff(lengths(tool.du)) * 60
    assert (np.abs(change) * outside[1:]).max() <= 5.0 + 0.1


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize(
    ("bad", "stop"),
    [
        ({}, Stop.MOVING),
        ({"known": 0.0}, Stop.OBSTACLE_LOST),
        ({"known": 0.0, "sigma_p": 1.0}, Stop.WAITING),
        ({"p": (math.nan, 0.0, 0.0)}, Stop.NOT_A_NUMBER),
        ({"known": math.nan}, Stop.NOT_A_NUMBER),
    ],
)
def test_one_of_three_obstacles_is_enough_to_stop(place, bad, stop):
    obstacles = [example(Estimate)] * 3
    obstacles[place] = obstacles[place]._replace(**bad)
    tool, codes = run([0.01, 0.0, 0.0], 0.5, obstacles=obstacles)
    assert codes[-1] == stop
    speed = lengths(tool.v[-1])
    assert (speed > 0.01) if stop == Stop.MOVING else speed == 0.0


def test_every_stop_has_a_text_of_its_own():
    assert [*Stop] == [*range(len(Stop))]
    assert len({stop.text for stop in Stop}) == len(Stop)
    assert Stop(4.0).text == "target out of reach"


def test_an_arm_that_does_not_follow_stops_the_tool():
    dut = ToolNavigation()
    context = dut.CreateDefaultContext()
    for i in range(dut.num_input_ports()):
        port = dut.get_input_port(i)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    away = RobotTool(P_WG, (0.04, 0.0, -0.12))
    dut.GetInputPort("robot_tool").FixValue(context, flat(away))
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.1)
    assert dut.GetOutputPort("stop").Eval(context).item() == Stop.NOT_FOLLOWED
    dut.GetInputPort("robot_tool").FixValue(context, flat(example(RobotTool)))
    simulator.AdvanceTo(0.2)
    assert dut.GetOutputPort("stop").Eval(context).item() == Stop.MOVING


def test_limits_leave_free_motion_alone():
    params = constants(ToolNavigationParams())[0]
    tip = (0.0, 0.0, -0.1)
    v = limit_tip_velocity(params, P_WG, tip, (0.05, 0.0, 0.0), WIDE_CONE)
    assert v == pytest.approx((0.05, 0.0, 0.0))
    assert reachable(params, P_WG, (0.0, 0.0, -0.1))
    assert not reachable(params, P_WG, (0.0, 0.0, -0.01))


def test_the_limits_are_the_planners_own():
    params = ToolNavigationParams(max_insertion=0.15)
    assert {f.name for f in fields(ReachLimits)} <= {f.name for f in fields(params)}
    record = workspace_constants(params)[0]
    assert all(record[f.name] == getattr(params, f.name) for f in fields(ReachLimits))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("period", 0.0),
        ("tip_speed", -1.0),
        ("turning_speed", math.nan),
        ("min_insertion", 0.3),
        ("max_tilt", 1.7),
        ("max_tilt", 40.0),
        ("follow_error", 1e9),
        ("cone_margin", -0.1),
    ],
)
def test_bad_parameters_are_named(name, value):
    with pytest.raises(ValueError, match=f"tool_navigation.{name}={value}.*expected"):
        ToolNavigation(ToolNavigationParams(**{name: value}))
