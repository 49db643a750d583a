"""Tests of the joint commands: against Drake's own inverse kinematics, and limits."""

import numpy as np
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
import pytest

from plants.arm.arm import SetPoint
from plants.arm.controller_plant import (
    INSTRUMENT_TIP,
    accelerations,
    make_controller_plant,
)
from plants.arm.parameters import READY_POSTURE
from systems.common.signal import flat, size, vector
from systems.common.signals import CALM, Permission, ToolMotion
from systems.common.stops import Stop
from systems.motion import joint_commands
from systems.motion.joint_commands import LIMP, JointCommands, JointCommandsParams
from systems.motion.joint_velocity import free_velocity, joint_velocity

PLANT = make_controller_plant()
TIP = PLANT.GetFrameByName(INSTRUMENT_TIP)
PERIOD = JointCommandsParams().period


def kinematics(q):
    """Context, tip position, shaft direction and Jacobian at a posture."""
    context = PLANT.CreateDefaultContext()
    PLANT.SetPositions(context, q)
    X_WT = TIP.CalcPoseInWorld(context)
    world = PLANT.world_frame()
    J = PLANT.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, TIP, np.zeros(3), world, world
    )
    return context, X_WT.translation(), X_WT.rotation().col(2), J


def test_velocities_agree_with_drakes_own_inverse_kinematics():
    rng = np.random.default_rng(1)
    speed = np.ones(7)
    limits = DifferentialInverseKinematicsParameters(7, 7)
    limits.set_time_step(PERIOD)
    limits.set_joint_velocity_limits((-speed, speed))
    limits.set_nominal_joint_position(np.array(READY_POSTURE))
    limits.set_joint_centering_gain(0.2 * np.eye(7))
    for _ in range(30):
        q = READY_POSTURE + rng.uniform(-0.2, 0.2, 7)
        context, _, _, J = kinematics(q)
        V = rng.uniform(-0.05, 0.05, 6)
        ours = joint_velocity(J, V, 0.2 * (READY_POSTURE - q), -speed, speed)
        drake = DoDifferentialInverseKinematics(PLANT, context, V, TIP, limits)
        np.testing.assert_allclose(ours, drake.joint_velocities, atol=2e-3)
        np.testing.assert_allclose(J @ ours, V, atol=1e-4)


def random_problem(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(6, 7)), rng.normal(size=6), rng.normal(size=7)


@pytest.mark.parametrize("seed", range(5))
def test_free_minimum_is_the_quadratic_programs_without_bounds(seed):
    J, V, v_nominal = random_problem(seed)
    wide = np.full(7, 1e3)
    expected = joint_velocity(J, V, v_nominal, -wide, wide)
    v = free_velocity(J, V, v_nominal)
    np.testing.assert_allclose(v, expected, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(J @ v, V, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_bounded_minimum_cannot_be_improved(seed):
    J, V, v_nominal = random_problem(seed)
    limit = 0.5 * abs(free_velocity(J, V, v_nominal)).max()
    high = np.full(7, limit)
    v = joint_velocity(J, V, v_nominal, -high, high)
    assert abs(v).max() == pytest.approx(limit)
    gradient = J.T @ (J @ v - V) + 1e-6 * (v - v_nominal)
    inside = abs(v) < limit - 1e-9
    np.testing.assert_allclose(gradient[inside], 0.0, atol=1e-6)
    assert (gradient[~inside] * v[~inside] <= 1e-9).all()


def test_bounds_hold_and_lead_back():
    _, _, _, J = kinematics(READY_POSTURE)
    low, high = -np.full(7, 0.1), np.full(7, 0.1)
    v = joint_velocity(J, np.array([0.0, 0, 0, 1.0, 1.0, 0]), np.zeros(7), low, high)
    assert v.max() <= 0.1 + 1e-9 and v.min() >= -0.1 - 1e-9
    high[3] = -0.05  # the joint stands beyond its stop
    v = joint_velocity(J, np.zeros(6), np.zeros(7), low, high)
    assert v[3] <= -0.05 + 1e-9


def test_twist_keeps_the_roll():
    u = np.array([0.1, -0.2, -0.97])
    u /= np.linalg.norm(u)
    du = np.cross([0.3, 0.1, 0.2], u)
    tip = (0.0, 0.0, -0.1)
    tool = ToolMotion(tip, vector(u), (0.01, 0.0, 0.0), vector(du), 1.0)
    w, v = joint_commands.tool_twist(tip, vector(u), tool, 1.0, PERIOD, 0.3, 0.1)
    twist = np.array([*w, *v])
    assert twist[:3] @ u == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.cross(twist[:3], u), du, atol=1e-12)
    np.testing.assert_allclose(twist[3:], [0.01, 0.0, 0.0])


def follow(tool_at, seconds, params=None, told=None):
    """Runs the block on a commanded motion; rows of posture, set-point, status."""
    dut = JointCommands(params)
    context = dut.CreateDefaultContext()
    simulator = Simulator(dut, context)
    for name, value in (told or {}).items():
        dut.GetInputPort(name).FixValue(context, value)
    rows = []
    for k in range(round(seconds * 120)):
        dut.GetInputPort("tool").FixValue(context, flat(tool_at(k / 120)))
        simulator.AdvanceTo((k + 0.5) / 120)
        names = ("posture", "set_point", "status")
        rows.append([np.array(dut.GetOutputPort(n).Eval(context)) for n in names])
    return rows


def circle(t, radius=0.02, rate=2.0):
    """A circle about the ready posture's tip, through the fulcrum at the origin."""
    p = np.array([radius * np.sin(rate * t), radius * (1 - np.cos(rate * t)), -0.12])
    v = radius * rate * np.array([np.cos(rate * t), np.sin(rate * t), 0.0])
    q = np.linalg.norm(p)
    u = p / q
    return ToolMotion(p, u, v, (v - (v @ u) * u) / q, t)


def test_the_posture_follows_a_circle_through_the_fulcrum():
    rows = follow(circle, 3.0)
    for k, (posture, _, status) in enumerate(rows[60:], start=60):
        tool = circle((k + 1) / 120)
        _, p, u, _ = kinematics(posture)
        assert np.linalg.norm(p - tool.tip) < 1e-4
        assert np.linalg.norm(u - tool.u) < 1e-3
        assert status[0] == 0.0


def test_set_points_are_the_servos_for_the_motion_and_the_weight():
    (before, _, _), (after, set_point, _) = follow(circle, 0.5)[-2:]
    context, *_ = kinematics(before)
    weight = PLANT.CalcGravityGeneralizedForces(context)
    v = (after - before) / PERIOD
    expected = SetPoint(period=PERIOD)(before, v, -weight)
    np.testing.assert_allclose(set_point, expected, atol=1e-9)


def test_too_fast_a_command_is_reported_and_bounded():
    def fast(t):
        tip, u, still = (0.5 * t, 0.0, -0.12), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
        return ToolMotion(tip, u, (0.5, 0.0, 0.0), still, t)

    rows = follow(fast, 0.3, JointCommandsParams(joint_speed=0.05))
    speed = PLANT.GetVelocityUpperLimits() * 0.05
    step = np.diff([posture for posture, _, _ in rows], axis=0) / PERIOD
    assert (np.abs(step) <= speed + 1e-6).all()
    assert rows[-1][2][0] == 1.0


def test_joints_change_speed_no_faster_than_their_torque_allows():
    """The command leaps by 20 mm: the arm is there soon, and was asked no more."""

    def leap(t):
        tip, u, still = (0.02, 0.0, -0.12), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
        return ToolMotion(tip, u, still, still, t)

    most = accelerations(PLANT, np.array(READY_POSTURE)) * PERIOD

    def leaping(share):
        rows = follow(leap, 1.0, JointCommandsParams(joint_torque=share))
        v = np.diff([READY_POSTURE, *(row[0] for row in rows)], axis=0) / PERIOD
        return abs(np.diff(v, axis=0, prepend=0.0)) / most, kinematics(rows[-1][0])[1]

    share, tip = leaping(0.2)
    assert share.max() == pytest.approx(0.2, rel=1e-6)
    np.testing.assert_allclose(tip, [0.02, 0.0, -0.12], atol=1e-4)
    assert leaping(1.0)[0].max() > 0.3


def test_the_tool_rolls_about_its_shaft_alone():
    params = JointCommandsParams(roll=0.5, roll_period=5.0)
    ends = [follow(circle, 2.5, p)[-1][0] for p in (None, params)]
    (_, p, u, _), (_, p_r, u_r, _) = map(kinematics, ends)
    np.testing.assert_allclose(p_r, p, atol=1e-5)
    np.testing.assert_allclose(u_r, u, atol=1e-4)
    x, x_r = (TIP.CalcPoseInWorld(kinematics(q)[0]).rotation().col(0) for q in ends)
    assert np.arccos(x @ x_r) == pytest.approx(0.5, abs=2e-3)


def off_fulcrum(posture):
    """How far the shaft's line passes the origin, in m."""
    _, p, u, _ = kinematics(posture)
    return np.linalg.norm(p - (p @ u) * u)


def test_where_not_all_can_be_had_the_fulcrum_comes_first():
    """Joints too slow for the circle: the tip lags, the shaft keeps to its fulcrum."""
    params = JointCommandsParams(joint_speed=0.02, fulcrum_first=30.0)
    told = {"fulcrum": np.zeros(3)}
    first = [off_fulcrum(row[0]) for row in follow(circle, 2.0, params, told)]
    last = [off_fulcrum(row[0]) for row in follow(circle, 2.0, params)]
    assert max(first) < 1.2e-3
    assert max(last) > 4.0 * max(first)


def test_near_a_tool_the_tip_lags_less():
    """No tool is touched, before the wall is not loaded."""
    params = JointCommandsParams(joint_speed=0.05)
    lag, off = [], []
    for near in (0.0, 1.0):
        told = {"fulcrum": np.zeros(3), "clearance": flat(CALM._replace(near=near))}
        rows = follow(circle, 1.0, params, told)
        tips = [kinematics(row[0])[1] for row in rows]
        wanted = [circle((k + 1) / 120).tip for k in range(len(rows))]
        lag.append(np.linalg.norm(np.subtract(tips, wanted), axis=1).max())
        off.append(max(off_fulcrum(row[0]) for row in rows))
    assert lag[1] < 0.8 * lag[0] and off[1] > off[0]


def test_an_arm_that_does_not_follow_goes_limp():
    stuck = np.concatenate([READY_POSTURE, np.zeros(7)])
    params = JointCommandsParams()
    rows = follow(circle, 1.0, params, {"fulcrum": np.zeros(3), "arm_state": stuck})
    status = np.array([row[2][0] for row in rows])
    assert (status == LIMP).any()
    limp = int(np.flatnonzero(status == LIMP)[0])
    np.testing.assert_allclose(rows[limp][0], READY_POSTURE)  # told where it is
    assert (status[limp : limp + round(params.limp_time * 120)] == LIMP).all()


def test_an_arm_that_does_not_turn_about_its_fulcrum_goes_limp():
    """About the fulcrum it is off in direction alone: 30 mrad, then 10."""
    _, p, u, J = kinematics(READY_POSTURE)
    e = np.cross(u, [1.0, 0.0, 0.0])
    e /= np.linalg.norm(e)
    twist = np.concatenate([e, np.zeros(3)])  # about the tip, which stands for it
    for angle, is_limp in ((0.03, True), (0.01, False)):
        q = READY_POSTURE + np.linalg.pinv(J) @ (angle * twist)
        told = {"fulcrum": p, "arm_state": np.concatenate([q, np.zeros(7)])}
        assert (follow(circle, 0.02, None, told)[-1][2][0] == LIMP) == is_limp


@pytest.mark.parametrize("stop", [Stop.WALL_LOADED, Stop.SENSOR_LOST])
def test_a_loaded_wall_makes_the_arm_give_way(stop):
    permission = flat(Permission(0.0, float(stop)))
    away = np.array(READY_POSTURE) + 0.01
    measured = np.concatenate([away, np.zeros(7)])
    told = {"permission": permission, "arm_state": measured}
    posture, set_point, status = follow(circle, 0.1, None, told)[-1]
    np.testing.assert_allclose(posture, away)
    assert abs(set_point[:7] - away).max() < 1e-3  # but for the load's weight
    assert status[0] == LIMP


def test_quadprog_is_asked_only_where_bounds_are_met(monkeypatch):
    asked = []

    def watched(*args):
        asked.append(args)
        return joint_velocity(*args)

    monkeypatch.setattr(joint_commands, "joint_velocity", watched)
    follow(lambda t: circle(t, 0.005), 0.1)  # slow enough to begin at once
    assert not asked
    follow(circle, 0.1, JointCommandsParams(joint_speed=0.01))
    assert asked


def test_a_command_that_is_no_number_holds_the_arm():
    rows = follow(lambda t: (np.nan,) * size(ToolMotion), 0.1)
    np.testing.assert_allclose(rows[-1][0], READY_POSTURE)
    assert rows[-1][2][0] == 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("period", 0.0), ("gain", 1.5), ("joint_speed", 0.0), ("joint_margin", -1.0)],
)
def test_bad_parameters_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        JointCommands(JointCommandsParams(**{name: value}))
