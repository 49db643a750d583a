"""Tests of the tool's navigation: fulcrum geometry, limits, stops."""

import math

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from systems.motion.tool_navigation import (
    MOVING,
    ToolNavigation,
    ToolNavigationParams,
    constants,
    limit_tip_velocity,
    reachable,
)

P_WG = (0.0, 0.0, 0.0)
WIDE_CONE = (0.0, -0.05, 0.0, 0.0, 0.0, -1.0, 1.4)


def run(v_R, seconds=0.5, s=0.5, params=None, p_WP=(0.0, 0.0, -0.1), **changes):
    """Drives the block with constant inputs; the arm follows exactly."""
    dut = ToolNavigation(params, p_WP, P_WG)
    context = dut.CreateDefaultContext()
    inputs = {
        dut.get_input_port(i).get_name(): dut.AllocateInputVector(
            dut.get_input_port(i)
        ).value()
        for i in range(dut.num_input_ports())
    }
    inputs["v_R"] = np.array(v_R, float)
    inputs["guide"][7] = s
    inputs["view_cone"] = np.array(WIDE_CONE)
    for name, value in changes.items():
        inputs[name] = np.array(value, float)
    for name, value in inputs.items():
        dut.GetInputPort(name).FixValue(context, value)
    simulator = Simulator(dut, context)
    simulator.Initialize()
    rows = []
    for k in range(int(seconds * 60)):
        tool = dut.GetOutputPort("tool").Eval(context)
        dut.GetInputPort("robot_tool").FixValue(context, [*P_WG, *tool[:3]])
        simulator.AdvanceTo((k + 0.5) / 60)
        rows.append(
            [
                *dut.GetOutputPort("tool").Eval(context),
                *dut.GetOutputPort("stop").Eval(context),
            ]
        )
    return np.array(rows)


def test_the_tip_moves_with_the_guide_points_velocity_over_s():
    rows = run([0.01, 0.0, 0.0], s=0.5)
    np.testing.assert_allclose(rows[-1, 6:9], [0.02, 0.0, 0.0], atol=1e-12)
    # The guide point lies at s times the tip, so it moves with v_R.
    velocity = 0.5 * (rows[-1, :3] - rows[-2, :3]) * 60
    np.testing.assert_allclose(velocity, [0.01, 0.0, 0.0], atol=1e-9)


def test_shaft_points_from_the_fulcrum_to_the_tip_and_turns_with_it():
    rows = run([0.008, 0.005, 0.004])
    u = rows[:, :3] / np.linalg.norm(rows[:, :3], axis=1)[:, None]
    np.testing.assert_allclose(rows[:, 3:6], u, atol=1e-12)
    rate = np.gradient(u, 1 / 60, axis=0)
    np.testing.assert_allclose(rows[5:-1, 9:12], rate[5:-1], atol=2e-3)


def test_speed_turning_and_acceleration_are_bounded():
    params = ToolNavigationParams(
        tip_speed=0.1, turning_speed=0.3, acceleration=0.5, max_insertion=0.15
    )
    rows = run([1.0, 0.0, 0.2], 0.3, 1.0, params)
    speed = np.linalg.norm(rows[:, 6:9], axis=1)
    assert speed.max() <= 0.1 + 1e-12
    assert np.linalg.norm(rows[:, 9:12], axis=1).max() <= 0.3 + 1e-6
    change = np.linalg.norm(np.diff(rows[:, 6:9], axis=0), axis=1) * 60
    assert change.max() <= 0.5 + 1e-9


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
    rows = run(v_R, 3.0, 1.0, params, target=target_at([0.0, 0.01, -0.1]))
    assert all(limit(p) for p in rows[:, :3])
    # It reached the border: the limit was really met.
    assert np.linalg.norm(rows[-1, 6:9]) < 0.05


def test_gauze_stays_in_the_view_cone():
    cone = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.35]
    rows = run([0.03, 0.0, 0.0], 3.0, 1.0, view_cone=cone)
    angle = np.arctan2(np.hypot(rows[:, 0], rows[:, 1]), -rows[:, 2])
    assert angle.max() <= 0.35
    assert angle.max() > 0.3


def target_at(point, known=1.0):
    """An estimate of S at a point."""
    return [*point, *[0.0] * 6, 0.1, 0.0, 0.0, 1e-4, 1e-3, 0.1, known, 0.0]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({}, MOVING),
        ({"target": target_at([0.03, 0.0, -0.1], known=0.0)}, 1),
        ({"obstacle": target_at([0.03, 0.0, -0.1], known=0.0)}, 2),
        ({"guide": [math.nan] * 12}, 3),
        ({"target": target_at([0.0, 0.0, -0.5])}, 4),
        ({"target": target_at([0.2, 0.0, -0.1])}, 4),
        ({"view_cone": [0.1, 0.0, 0.0, 0.0, 0.0, -1.0, 0.3]}, 5),
    ],
)
def test_why_the_robot_stands(changes, code):
    rows = run([0.01, 0.0, 0.0], 0.5, **changes)
    assert rows[-1, 13] == code
    speed = np.linalg.norm(rows[-1, 6:9])
    assert np.isfinite(rows).all()
    assert (speed > 0.01) if code == MOVING else speed == 0.0


def test_an_arm_that_does_not_follow_stops_the_tool():
    dut = ToolNavigation()
    context = dut.CreateDefaultContext()
    for i in range(dut.num_input_ports()):
        port = dut.get_input_port(i)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    dut.GetInputPort("robot_tool").FixValue(context, [0, 0, 0, 0.02, 0, -0.1])
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.1)
    assert dut.GetOutputPort("stop").Eval(context)[0] == 6


def test_limits_leave_free_motion_alone():
    params = constants(ToolNavigationParams())[0]
    tip = (0.0, 0.0, -0.1)
    v = limit_tip_velocity(params, P_WG, tip, (0.05, 0.0, 0.0), np.array(WIDE_CONE))
    assert v == pytest.approx((0.05, 0.0, 0.0))
    assert reachable(params, P_WG, (0.0, 0.0, -0.1))
    assert not reachable(params, P_WG, (0.0, 0.0, -0.01))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("period", 0.0),
        ("tip_speed", -1.0),
        ("turning_speed", math.nan),
        ("min_insertion", 0.3),
        ("max_tilt", 1.7),
        ("cone_margin", -0.1),
    ],
)
def test_bad_parameters_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        ToolNavigation(ToolNavigationParams(**{name: value}))
