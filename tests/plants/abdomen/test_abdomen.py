"""The trocar spring: what the wall does to a shaft off the fulcrum."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
import pytest

from plants.abdomen.abdomen import AbdomenParams, add_abdomen

WEIGHT = np.array([0.0, 0.0, -9.81])


def tilted(angle, turn, depth, offset):
    """A tip and an aim whose line passes `offset` beside the origin.

    Returns:
        The aim, the tip and the sideways unit vector.
    """
    a, t = math.radians(angle), math.radians(turn)
    u = np.array([math.sin(a) * math.cos(t), math.sin(a) * math.sin(t), -math.cos(a)])
    side = np.cross(u, [math.cos(0.7), math.sin(0.7), 0.0])
    side /= np.linalg.norm(side)
    return offset * side, offset * side + depth * u, side


@pytest.mark.parametrize("stiffness", [100.0, 500.0, 3000.0])
@pytest.mark.parametrize(("angle", "turn"), [(0, 0), (25, 40), (25, 220), (35, 130)])
def test_wall_pulls_the_shaft_sideways_with_k_times_the_offset(
    make_scene, stiffness, angle, turn
):
    offset = 1.0 / stiffness  # 1 N
    aim, tip, side = tilted(angle, turn, 0.12, offset)
    scene = make_scene(
        p_WP=tip, aim=aim, abdomen_params=AbdomenParams(stiffness=stiffness)
    )
    scene.simulator.AdvanceTo(1.5)
    force = scene.output(scene.wall_force, "force")
    # The arm gives way, so the force is less than 1 N and turned a little.
    error = scene.output(scene.wall_force, "fulcrum_error")[0]
    assert error == pytest.approx(offset, rel=0.25 if stiffness > 1e3 else 0.06)
    assert np.linalg.norm(force) == pytest.approx(stiffness * error, rel=1e-3)
    np.testing.assert_allclose(force, -stiffness * error * side, atol=0.02)

    # What Drake's bushing does to the sleeve, across the shaft, is that force.
    X_WC = scene.abdomen.sleeve.EvalPoseInWorld(scene.context)
    u = X_WC.rotation().col(2)
    bushing = scene.abdomen.bushing.CalcBushingSpatialForceOnFrameC(scene.context)
    on_sleeve = X_WC.rotation() @ bushing.translational()
    np.testing.assert_allclose(on_sleeve - (on_sleeve @ u) * u, force, atol=1e-3)
    assert abs(on_sleeve @ u) <= scene.abdomen.params.seal_friction + 1e-3

    # The sensor feels it, and where: with the tool's weight taken away,
    # lambda = (u x f) . m / |f|^2 is the sleeve's place on the shaft.
    X_WM = scene.instrument.body.EvalPoseInWorld(scene.context)
    axis = X_WM.rotation().col(2)
    params = scene.instrument.params
    reaction = scene.reaction()
    f = -(X_WM.rotation() @ reaction.translational()) - params.mass * WEIGHT
    m = -(X_WM.rotation() @ reaction.rotational()) - np.cross(
        params.centre * axis, params.mass * WEIGHT
    )
    f_perp = f - (f @ axis) * axis
    np.testing.assert_allclose(f_perp, force, atol=5e-3)
    place = np.cross(axis, f_perp) @ m / (f_perp @ f_perp)
    sleeve = scene.abdomen.sleeve_joint.get_translation(scene.context)
    assert place == pytest.approx(sleeve, abs=2e-3)


def test_nothing_but_friction_acts_along_the_shaft(make_scene):
    scene = make_scene(abdomen_params=AbdomenParams(seal_friction=0.25))
    scene.abdomen.sleeve_joint.set_translation(
        scene.context, scene.abdomen.sleeve_joint.get_translation(scene.context) + 0.01
    )
    scene.simulator.AdvanceTo(1.5)
    # The spring of 500 N/m brings the sleeve back until friction holds it.
    X_WC = scene.abdomen.sleeve.EvalPoseInWorld(scene.context)
    assert 0.0 <= abs(X_WC.translation()[2]) <= 0.25 / 500.0 * 1.02


def felt_force(scene):
    """What the wall does to the instrument: sensor, weight and inertia."""
    body = scene.instrument.body
    mass = scene.instrument.params.mass
    reaction = body.EvalPoseInWorld(scene.context).rotation() @ (
        scene.reaction().translational()
    )
    acceleration = body.EvalSpatialAccelerationInWorld(scene.context)
    return mass * (acceleration.translational() - WEIGHT) - reaction


@pytest.mark.parametrize("friction", [0.25, 3.0])
def test_pushing_the_shaft_in_meets_the_seals_friction(make_scene, friction):
    params = AbdomenParams(seal_friction=friction, seal_viscosity=2.0)
    speed = 0.03
    scene = make_scene(
        abdomen_params=params,
        p_WP_of_time=lambda t: (0.0, 0.0, -0.08 - speed * t),
        duration=1.5,
    )
    scene.simulator.AdvanceTo(0.5)
    felt = []
    for k in range(61, 121):
        scene.simulator.AdvanceTo(k / 120)
        felt.append(felt_force(scene)[2])
    # Upwards on a shaft that goes down.
    assert np.mean(felt) == pytest.approx(friction + 2.0 * speed, abs=0.05)


@pytest.mark.parametrize("stiffness", [500.0, 3000.0])
def test_wall_servo_steps_18_mm_in_a_few_hundredths(make_scene, stiffness):
    scene = make_scene(abdomen_params=AbdomenParams(stiffness=stiffness))
    scene.simulator.AdvanceTo(0.5)
    root = scene.simulator.get_mutable_context()
    source = scene.simulator.get_system().GetSubsystemByName("wall_still")
    step = [0.018, 0, 0, 0, 0, 0]
    source.get_mutable_source_value(source.GetMyContextFromRoot(root)).SetFromVector(
        step
    )
    scene.simulator.AdvanceTo(0.55)
    assert scene.abdomen.wall.EvalPoseInWorld(scene.context).translation()[
        0
    ] == pytest.approx(0.018, abs=1e-3)
    scene.simulator.AdvanceTo(1.5)
    force = scene.output(scene.wall_force, "force")
    error = scene.output(scene.wall_force, "fulcrum_error")[0]
    assert force[0] == pytest.approx(stiffness * error, rel=1e-3)
    assert 0.6 * 0.018 < error < 0.018


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (AbdomenParams(stiffness=-5.0), "abdomen.stiffness=-5.0 N/m: expected >= 10"),
        (AbdomenParams(seal_friction=50.0), "seal_friction=50.0 N: .*<= 20"),
        (AbdomenParams(damping=math.nan), "abdomen.damping=nan"),
    ],
)
def test_impossible_parameters_are_refused(params, message):
    plant = MultibodyPlant(time_step=0.0)
    with pytest.raises(ValueError, match=message):
        add_abdomen(plant, plant.world_frame(), params=params)


def test_fulcrum_must_be_a_point():
    plant = MultibodyPlant(time_step=0.0)
    with pytest.raises(ValueError, match="must be three finite numbers"):
        add_abdomen(plant, plant.world_frame(), p_PG=[0.0, math.nan, 0.0])
