"""The arm against its published figures, and its servos under CENIC."""

import math
import timeit

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import (
    PdControllerGains,
    PrismaticJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    LinearSystem,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial
import pytest

from plants.arm.arm import ArmParams, SetPoint, add_arm, servo_step
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import (
    FRICTION,
    POSITION_LIMIT,
    READY_POSTURE,
    SPEED_LIMIT,
    TORQUE_LIMIT,
)
from plants.arm.posture import home_posture

# Mass, centre of mass, printed Ixx Iyy Izz.
PUBLISHED = {
    1: (9.22, [0, 0, -0.01], [0.122706, 0.122706, 0.0530564]),
    2: (4.51, [0, -0.2, 0], [0.055035, 0.055035, 0.018144]),
    3: (5.64, [0, 0, -0.035], [0.008124, 0.008124, 0.00572413]),
    4: (2.04, [0, -0.115, 0], [0.008124, 0.008124, 0.00572413]),
    5: (2.61, [0, 0, -0.084], [0.002546, 0.002546, 0.002747]),
    6: (2.07, [0, -0.042, 0], [0.002977, 0.002977, 0.001141]),
    7: (1.05, [0, 0, 0.022], [0.0005294, 0.0005294, 0.0004]),
}
EXCHANGED = (2, 4, 6)
MOTOR_INERTIA = [0.75, 0.75, 0.2125, 0.2125, 0.00575, 0.00575, 0.00575]


def arm_alone():
    plant = MultibodyPlant(time_step=0.0)
    arm = add_arm(plant)
    plant.Finalize()
    return plant, arm


def simulate(builder, accuracy=1e-3, scheme="cenic"):
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme=scheme, accuracy=accuracy, max_step_size=0.01
        ),
        simulator,
    )
    return simulator


def test_limits_friction_and_motors_are_the_published_ones():
    plant, arm = arm_alone()
    assert plant.num_positions() == 7
    np.testing.assert_allclose(plant.GetPositionUpperLimits(), POSITION_LIMIT)
    np.testing.assert_allclose(plant.GetPositionLowerLimits(), -POSITION_LIMIT)
    np.testing.assert_allclose(plant.GetVelocityUpperLimits(), SPEED_LIMIT)
    np.testing.assert_allclose(plant.GetEffortUpperLimits(), TORQUE_LIMIT)
    for i, index in enumerate(plant.GetJointActuatorIndices(arm)):
        actuator = plant.get_joint_actuator(index)
        reflected = actuator.default_reflected_inertia()
        assert reflected == pytest.approx(MOTOR_INERTIA[i])
        assert actuator.joint().default_damping() == FRICTION[i]


def test_links_have_the_published_inertias_about_their_centres():
    plant, _ = arm_alone()
    for i, (mass, centre, printed) in PUBLISHED.items():
        body = plant.GetBodyByName(f"link{i}")
        inertia = body.default_spatial_inertia()
        assert inertia.get_mass() == mass
        np.testing.assert_allclose(inertia.get_com(), centre)
        central = inertia.Shift(centre).CalcRotationalInertia()
        xx, yy, zz = printed
        expected = [xx, zz, yy] if i in EXCHANGED else [xx, yy, zz]
        np.testing.assert_allclose(central.get_moments(), expected, atol=1e-12)


@pytest.mark.parametrize("link", PUBLISHED)
def test_printed_inertias_about_the_frame_are_valid_for_link_1_alone(link):
    mass, centre, printed = PUBLISHED[link]
    about_frame = UnitInertia(*(np.array(printed) / mass))
    inertia = SpatialInertia(mass, centre, about_frame, skip_validity_check=True)
    assert inertia.IsPhysicallyValid() == (link == 1)


def test_arm_is_weightless_and_the_instrument_is_not():
    plant = make_controller_plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, READY_POSTURE)
    torque = plant.CalcGravityGeneralizedForces(context)
    # Shaft straight down, at 0.66 m from the shoulder's axis: 0.2 kg at joint 2.
    assert torque[1] == pytest.approx(0.2 * 9.81 * 0.66, rel=1e-4)
    tip = plant.GetFrameByName(INSTRUMENT_TIP).CalcPoseInWorld(context)
    np.testing.assert_allclose(tip.translation(), [0, 0, -0.12], atol=1e-5)
    np.testing.assert_allclose(tip.rotation().col(2), [0, 0, -1], atol=1e-5)


def test_every_joint_has_14_hz_of_bandwidth_and_damping():
    plant = make_controller_plant()
    context = plant.CreateDefaultContext()
    arm = plant.GetModelInstanceByName("pa10")
    tip = plant.GetFrameByName(INSTRUMENT_TIP)
    params = ArmParams()
    stiffness, damping = np.diag(params.kp), np.diag(np.add(params.kd, FRICTION))
    omega = 2.0 * math.pi * 14.0
    for angle, turn, depth in [(0, 0, 0.12), (35, 0, 0.06), (35, 180, 0.06)]:
        a, t = math.radians(angle), math.radians(turn)
        u = np.array([math.sin(a) * math.cos(t), math.sin(a) * math.sin(t), -1.0])
        u[2] = -math.cos(a)
        q = home_posture(plant, arm, tip, np.zeros(3), depth * u)
        plant.SetPositions(context, q)
        mass = plant.CalcMassMatrix(context)
        response = np.linalg.solve(
            stiffness + 1j * omega * damping - omega**2 * mass, stiffness
        )
        assert np.abs(np.diag(response)).min() > math.sqrt(0.5)
        poles = np.linalg.eigvals(
            np.block(
                [
                    [np.zeros((7, 7)), np.eye(7)],
                    [
                        -np.linalg.solve(mass, stiffness),
                        -np.linalg.solve(mass, damping),
                    ],
                ]
            )
        )
        assert (-poles.real / np.abs(poles)).min() > 0.55


def step_joint(index, size, duration, accuracy=1e-5):
    """Steps one joint's set-point; returns its positions at 1 kHz."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    arm = add_arm(plant)
    plant.Finalize()
    q = np.array(READY_POSTURE)
    q[index] += size
    source = builder.AddNamedSystem(
        "set_point", ConstantVectorSource(SetPoint()(q, np.zeros(7)))
    )
    builder.Connect(source.get_output_port(), plant.get_desired_state_input_port(arm))
    simulator = simulate(builder, accuracy)
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, READY_POSTURE)
    torques, positions = [], []
    for k in range(1, int(duration * 1000)):
        simulator.AdvanceTo(k / 1000)
        positions.append(plant.GetPositions(context)[index] - READY_POSTURE[index])
        torques.append(plant.get_net_actuation_output_port().Eval(context)[index])
    return np.array(positions), np.array(torques)


@pytest.mark.parametrize("index", [0, 3, 5])
def test_a_small_step_settles_without_ringing(index):
    size = 1e-3
    position, _ = step_joint(index, size, 0.25)
    assert position.max() < 1.12 * size
    assert abs(position[200:] / size - 1.0).max() < 0.02


def test_torque_limits_hold_under_cenic():
    # kp * 0.3 rad is far over 68 Nm.
    position, torque = step_joint(3, 0.3, 0.4, accuracy=1e-3)
    assert torque.max() == pytest.approx(TORQUE_LIMIT[3])
    assert position[-1] == pytest.approx(0.3, abs=2e-3)


def test_joint_limits_hold_under_cenic():
    beyond = 2.6 - READY_POSTURE[3]
    position, torque = step_joint(3, beyond, 1.0, accuracy=1e-3)
    assert READY_POSTURE[3] + position[-1] == pytest.approx(POSITION_LIMIT[3], abs=1e-4)
    assert torque[-1] == pytest.approx(TORQUE_LIMIT[3])


def ramp_shift(scheme, kp=5000.0, kd=300.0, rate=0.1, cured=False):
    """Stationary lead of a slider behind a ramp, its velocity sent or cured."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    body = plant.AddRigidBody("body", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    joint = plant.AddJoint(
        PrismaticJoint("joint", plant.world_frame(), body.body_frame(), [1, 0, 0])
    )
    plant.AddJointActuator("joint", joint).set_controller_gains(
        PdControllerGains(p=kp, d=kd)
    )
    plant.Finalize()
    ramp = PiecewisePolynomial.FirstOrderHold([0.0, 10.0], [[0.0, 10.0 * rate]])
    source = builder.AddNamedSystem(
        "ramp", TrajectorySource(ramp, output_derivative_order=1)
    )
    # Cured: (q_d + kd/kp v_d, 0).
    D = [[1.0, kd / kp], [0.0, 0.0]] if cured else np.eye(2)
    sent = builder.AddNamedSystem("sent", LinearSystem(D=D))
    builder.Connect(source.get_output_port(), sent.get_input_port())
    port = plant.get_desired_state_input_port(body.model_instance())
    builder.Connect(sent.get_output_port(), port)
    simulator = simulate(builder, 1e-5, scheme)
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    simulator.AdvanceTo(1.0)
    return plant.GetPositions(context)[0] - rate * 1.0


def test_cenic_still_has_the_wrong_sign_of_the_desired_velocity():
    kp, kd, rate = 5000.0, 300.0, 0.1
    assert ramp_shift("implicit_euler") == pytest.approx(0.0, abs=1e-4)
    assert ramp_shift("cenic") == pytest.approx(-2 * kd / kp * rate, abs=1e-3), (
        "CENIC now applies the desired velocity as the other integrators do: "
        "take the cure out of plants.arm.arm.SetPoint"
    )


def test_the_cure_is_exact_for_both_integrators():
    for scheme in ("cenic", "implicit_euler"):
        assert ramp_shift(scheme, cured=True) == pytest.approx(0.0, abs=1e-3)


def test_set_point_is_position_lead_and_feed_forward():
    params = ArmParams()
    q, v, tau = np.arange(7.0), np.full(7, 0.1), np.full(7, 5.0)
    kp, kd = np.array(params.kp), np.array(params.kd)
    sent = SetPoint(params, period=0.01)(q, v, tau)
    expected = q + ((kd + FRICTION) / kp + 0.01) * v + tau / kp
    np.testing.assert_allclose(sent, [*expected, *[0.0] * 7])
    # The servo's torque then is friction plus the feed-forward, for a motion on time.
    torque = kp * (sent[:7] - 0.01 * v - q) - kd * v
    np.testing.assert_allclose(torque, FRICTION * v + tau)


def test_what_is_left_of_a_lag_after_a_period():
    """The arm alone from a lag, moving, and told to go on: one step of CENIC."""
    period, params = 1 / 60, ArmParams()
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    arm = add_arm(plant)
    plant.Finalize()
    rng = np.random.default_rng(1)
    q_d = np.array(READY_POSTURE)
    lag, d, v = rng.normal(size=(3, 7)) * np.array([[1e-4], [1e-3], [0.05]])
    simulator = Simulator(builder.Build())
    config = SimulatorConfig(integration_scheme="cenic", max_step_size=period)
    config.use_error_control, config.accuracy = False, 1e-4
    ApplySimulatorConfig(config, simulator)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    sent = SetPoint(params, period)(q_d, d / period)
    plant.get_desired_state_input_port(arm).FixValue(context, sent)
    plant.SetPositionsAndVelocities(context, [*(q_d + lag), *v])
    simulator.AdvanceTo(period)
    left = plant.GetPositions(context) - (q_d + d)
    A, C = servo_step(arm_alone()[0], q_d, params, period)
    told = A @ lag + C @ (v * period - d)
    assert np.abs(left - told).max() < 0.02 * np.abs(left).max()
    assert np.abs(left - lag).max() > 0.3 * np.abs(left).max()


def test_set_point_takes_less_than_ten_microseconds():
    servo, q, v = SetPoint(), np.zeros(7), np.ones(7)
    best = min(timeit.repeat(lambda: servo(q, v), number=200, repeat=10)) / 200
    assert best < 10e-6


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (ArmParams(kp=[1.0] * 6), "arm.kp=.* N m/rad: expected 7 numbers > 0"),
        (ArmParams(kd=[1.0] * 6 + [-2.0]), r"arm.kd=.*-2.0. .*7 numbers > 0"),
        (ArmParams(kp=[math.nan] * 7), r"arm.kp=\[nan, .*7 numbers > 0"),
    ],
)
def test_bad_gains_are_refused(params, message):
    with pytest.raises(ValueError, match=message):
        SetPoint(params)
    with pytest.raises(ValueError, match=message):
        add_arm(MultibodyPlant(time_step=0.0), params=params)


def test_negative_period_is_refused():
    with pytest.raises(ValueError, match=r"period=-0.1 s must be >= 0"):
        SetPoint(period=-0.1)


def test_two_arms_fit_into_one_plant():
    plant = MultibodyPlant(time_step=0.0)
    first, second = add_arm(plant), add_arm(plant)
    plant.Finalize()
    assert first != second
    assert plant.num_positions() == 14
