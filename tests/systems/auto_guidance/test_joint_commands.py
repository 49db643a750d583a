"""Joint commands: the free minimum, the bounded one, and the arm that follows."""

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from plants.arm.arm import SetPoint
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from systems.auto_guidance import joint_commands
from systems.auto_guidance.joint_commands import (
    JointCommands,
    JointCommandsParams,
    free_velocity,
    joint_velocity,
)

WIDE = np.full(7, 1e3)


def problem(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(6, 7)), rng.normal(size=6), rng.normal(size=7)


@pytest.mark.parametrize("seed", range(5))
def test_free_minimum_is_the_quadratic_programs_without_bounds(seed):
    J, V, v_nominal = problem(seed)
    expected = joint_velocity(J, V, v_nominal, -WIDE, WIDE)
    v = free_velocity(J, V, v_nominal)
    np.testing.assert_allclose(v, expected, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(J @ v, V, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_bounds_hold_where_the_free_minimum_breaks_them(seed):
    J, V, v_nominal = problem(seed)
    limit = 0.5 * abs(free_velocity(J, V, v_nominal)).max()
    high = np.full(7, limit)
    v = joint_velocity(J, V, v_nominal, -high, high)
    assert abs(v).max() <= limit + 1e-12
    assert abs(v).max() == pytest.approx(limit)
    # A minimum: no step back from the bounds makes it better.
    gradient = J.T @ (J @ v - V) + 1e-6 * (v - v_nominal)
    inside = abs(v) < limit - 1e-9
    np.testing.assert_allclose(gradient[inside], 0.0, atol=1e-6)
    assert (gradient[~inside] * v[~inside] <= 1e-9).all()


def drive(velocity, seconds=0.5, params=None):
    """The command of a tool that moves from rest with a velocity in W [m/s]."""
    dut = JointCommands(params)
    context = dut.CreateDefaultContext()
    port = dut.GetInputPort("tool")
    start = dut.AllocateInputVector(port).value()
    start[6:9] = velocity
    simulator = Simulator(dut, context)
    for k in range(round(seconds * 60)):
        tool = start.copy()
        tool[:3] += start[6:9] * k / 60
        tool[12] = k / 60
        port.FixValue(context, tool)
        simulator.AdvanceTo((k + 0.99) / 60)
    return dut, context, start


def tip_at(posture):
    plant = make_controller_plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, posture)
    return plant.GetFrameByName(INSTRUMENT_TIP).CalcPoseInWorld(context)


def test_posture_carries_the_tool_along():
    dut, context, start = drive([0.03, 0.01, -0.02])
    X_WT = tip_at(dut.GetOutputPort("posture").Eval(context))
    # 60 updates of 1/120 s: the posture is the one of the next instant.
    np.testing.assert_allclose(
        X_WT.translation(), start[:3] + 0.5 * start[6:9], atol=2e-5
    )
    np.testing.assert_allclose(X_WT.rotation().col(2), start[3:6], atol=1e-4)
    assert dut.GetOutputPort("status").Eval(context)[0] == 0.0


def test_joint_speeds_are_kept_and_said():
    params = JointCommandsParams(joint_speed=0.02)
    plant = make_controller_plant()
    limit = 0.02 * plant.GetVelocityUpperLimits()
    dut, context, _ = drive([0.1, 0.0, 0.0], params=params)
    moved = dut.GetOutputPort("posture").Eval(context)
    context.SetTime(context.get_time() + 1e-6)
    state = dut.EvalUniquePeriodicDiscreteUpdate(context)
    v = (state.value(0) - moved) / params.period
    assert (abs(v) <= limit + 1e-9).all()
    assert (abs(v) >= limit - 1e-9).any()
    assert dut.GetOutputPort("status").Eval(context)[0] == 1.0


def test_set_point_is_the_servos():
    dut, context, _ = drive([0.02, 0.0, 0.0])
    q = dut.GetOutputPort("posture").Eval(context)
    state = dut.EvalUniquePeriodicDiscreteUpdate(context)
    v = (state.value(0) - q) / JointCommandsParams().period
    plant = make_controller_plant()
    plant_context = plant.CreateDefaultContext()
    plant.SetPositions(plant_context, q)
    weight = plant.CalcGravityGeneralizedForces(plant_context)
    expected = SetPoint(period=JointCommandsParams().period)(q, v, -weight)
    np.testing.assert_allclose(state.value(1), expected, atol=1e-12)


def test_command_that_is_not_finite_holds_the_arm():
    dut, context, start = drive([0.02, 0.0, 0.0])
    q = dut.GetOutputPort("posture").Eval(context)
    start[4] = np.nan
    dut.GetInputPort("tool").FixValue(context, start)
    state = dut.EvalUniquePeriodicDiscreteUpdate(context)
    np.testing.assert_array_equal(state.value(0), q)
    assert state.value(2)[0] == 1.0


def test_quadprog_is_asked_only_where_bounds_are_met(monkeypatch):
    asked = []
    solve = joint_commands.joint_velocity
    monkeypatch.setattr(
        joint_commands,
        "joint_velocity",
        lambda *args: asked.append(1) or solve(*args),
    )
    drive([0.02, 0.0, 0.0], 0.1)
    assert not asked
    drive([0.1, 0.0, 0.0], 0.1, JointCommandsParams(joint_speed=0.02))
    assert asked
