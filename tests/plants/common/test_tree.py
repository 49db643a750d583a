"""Compiled kinematics of a plant against Drake's own."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BallRpyJoint, BodyIndex, SpatialInertia
import pytest

from plants.abdomen.abdomen import add_abdomen, spring_on_sleeve, turning_on_sleeve
from plants.arm.arm import add_arm
from plants.common.tree import mass_centre, momentum, move_tree, pose_in, read_tree
from plants.instruments.tube import TubeParams, add_tube, channel_frame
from plants.snake.snake import add_snake


def test_bodies_momentum_and_spring_are_drakes():
    plant, tube = MultibodyPlant(0.0), TubeParams()
    hung = add_tube(plant, plant.GetFrameByName("flange", add_arm(plant)), tube)
    abdomen = add_abdomen(plant, hung.body.body_frame())
    snake = add_snake(plant, channel_frame(plant, hung, tube)).instance
    plant.Finalize()
    tree, context = read_tree(plant), plant.CreateDefaultContext()
    rng = np.random.default_rng(1)
    q, v = 0.3 * rng.normal(size=(2, plant.num_positions()))
    plant.SetPositionsAndVelocities(context, [*q, *v])
    X, V = np.zeros((plant.num_bodies(), 12)), np.zeros((plant.num_bodies(), 6))
    move_tree(tree[0], q, v, X, V)
    for i in range(plant.num_bodies()):
        body = plant.get_body(BodyIndex(i))
        pose = body.EvalPoseInWorld(context)
        np.testing.assert_allclose(X[i, :3], pose.translation(), atol=1e-13)
        R = pose.rotation().matrix()
        np.testing.assert_allclose(X[i, 3:].reshape(3, 3).T, R, atol=1e-13)
        moving = body.EvalSpatialVelocityInWorld(context).get_coeffs()
        np.testing.assert_allclose(V[i], moving, atol=1e-13)
    bodies = [int(i) for i in plant.GetBodyIndices(snake)]
    true = plant.CalcSpatialMomentumInWorldAboutPoint(context, [snake], np.zeros(3))
    h, p = np.sum([momentum(tree[0], i, X, V) for i in bodies], axis=0)
    np.testing.assert_allclose([*h, *p], true.get_coeffs(), atol=1e-14)
    weights = tree["mass"][0][bodies]
    centre = weights @ [mass_centre(tree[0], i, X) for i in bodies] / weights.sum()
    true = plant.CalcCenterOfMassPositionInWorld(context, [snake])
    np.testing.assert_allclose(centre, true, atol=1e-14)
    C, I = int(abdomen.sleeve.index()), int(abdomen.wall.index())  # noqa: E741
    K, D = abdomen.params.stiffness, abdomen.params.damping
    p, v = tuple(X[C, :3] - X[I, :3]), tuple(V[C, 3:] - V[I, 3:])
    torque, force = spring_on_sleeve(p, v, tuple(V[C, :3]), K, D)
    F = abdomen.bushing.CalcBushingSpatialForceOnFrameC(context)
    R = abdomen.sleeve.EvalPoseInWorld(context).rotation()
    np.testing.assert_allclose(force, R @ F.translational(), atol=1e-10)
    np.testing.assert_allclose(torque, R @ F.rotational(), atol=1e-10)
    k, d = np.array([0.3, 0.4, 0.1]), np.array([0.01, 0.02, 0.03])
    abdomen.bushing.SetTorqueStiffnessConstants(context, k)
    abdomen.bushing.SetTorqueDampingConstants(context, d)
    more = R @ abdomen.bushing.CalcBushingSpatialForceOnFrameC(context).rotational()
    turning = turning_on_sleeve(pose_in(X, C), tuple(V[C, :3]), k, d)
    np.testing.assert_allclose(np.add(torque, turning), more, atol=1e-10)


def test_other_joints_are_refused():
    plant = MultibodyPlant(0.0)
    body = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    joint = BallRpyJoint("socket", plant.world_frame(), body.body_frame())
    plant.AddJoint(joint)
    plant.Finalize()
    with pytest.raises(ValueError, match="socket: a ball_rpy joint"):
        read_tree(plant)
