"""The multibody plant against the kinematics, and the wires' drawn path."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import turns_of
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic import elastic_pull
from plants.snake.kinematics import forward, frames
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.snake import FAR, NEAR, POSITIONS, add_snake
from plants.snake.tension import length_jacobian
from plants.snake.wire_path import hanging_points, tangent_points, wires_at

PARAMS = SnakeParams()


def make_plant(time_step=0.0, elastic=False):
    plant = MultibodyPlant(time_step)
    snake = add_snake(plant, plant.world_frame(), elastic=elastic)
    plant.Finalize()
    return plant, snake


def positions(x):
    q = np.zeros(POSITIONS)
    q[NEAR], q[FAR] = x, x[1:]
    return q


def random_posture(rng):
    bends = np.stack([rng.uniform(-3, 3, 3), rng.uniform(0, PARAMS.max_bend, 3)], 1)
    return posture_of([rng.uniform(*PARAMS.travel), *bends.ravel()])


def test_seven_freedoms_and_the_pose_of_equation_1():
    plant, snake = make_plant()
    assert plant.num_positions() == POSITIONS == 13
    assert plant.num_constraints() == 6
    assert plant.num_actuators() == 7
    context, rng = plant.CreateDefaultContext(), np.random.default_rng(0)
    for _ in range(100):
        x = random_posture(rng)
        plant.SetPositions(context, positions(x))
        X_WT = snake.tool.CalcPoseInWorld(context).GetAsMatrix4()
        np.testing.assert_allclose(X_WT, forward(x, PARAMS), atol=1e-14)
        # The end plates' frames are the paper's O1, O2, O3, less 2h along z.
        for k, X_WO in enumerate(frames(x, PARAMS)[1:], start=1):
            plate = plant.GetBodyByName(f"plate{2 * k}").body_frame()
            R = plate.CalcPoseInWorld(context).rotation().matrix()
            np.testing.assert_allclose(R, X_WO[:3, :3], atol=1e-14)


def test_mass_is_that_of_an_8_mm_robot():
    plant, snake = make_plant()
    context = plant.CreateDefaultContext()
    moving = plant.CalcTotalMass(context) - snake.drive.carriage_mass
    assert 2e-3 < moving < 10e-3
    assert 2 * PARAMS.body_radius == pytest.approx(8e-3)


def test_springs_have_the_stiffness_of_the_wires():
    """At rest one module's own wires, k J^T J, give the default gain."""
    drive = SnakeDriveParams()
    J = length_jacobian(np.zeros(6), PARAMS)[6:, 4:]
    own = drive.wire_stiffness * J.T @ J
    np.testing.assert_allclose(own, 1.08 * np.eye(2), atol=1e-12)
    assert drive.kp == pytest.approx(1.08, rel=0.1)


def test_a_gain_of_zero_is_refused():
    with pytest.raises(ValueError, match=r"snake_drive.kp=0.0 .*the default is 1"):
        add_snake(MultibodyPlant(0.0), None, drive=SnakeDriveParams(kp=0.0))


def test_elastic_pull_is_stretch_through_the_jacobian():
    rng, drive = np.random.default_rng(3), SnakeDriveParams()
    for _ in range(30):
        x = random_posture(rng)
        ab = x[1:]
        J = length_jacobian(ab, PARAMS)
        wound = wire_lengths(x, PARAMS) - rng.uniform(-2e-4, 4e-4, 9)
        ab_rate, wound_rate = rng.normal(size=6), rng.normal(scale=0.01, size=9)
        T, tau = elastic_pull(ab, ab_rate, wound, wound_rate, PARAMS, drive)
        expected = drive.wire_stiffness * (wire_lengths(x, PARAMS) - wound)
        expected += drive.wire_damping * (J @ ab_rate - wound_rate)
        np.testing.assert_allclose(T, np.maximum(expected, 0.0), atol=1e-9)
        np.testing.assert_allclose(tau, -J.T @ T, atol=1e-12)
        broken = np.ones(9)
        broken[4] = 0.0
        T_broken, _ = elastic_pull(
            ab, ab_rate, wound, wound_rate, PARAMS, drive, broken
        )
        assert T_broken[4] == 0.0
        np.testing.assert_array_equal(np.delete(T_broken, 4), np.delete(T, 4))


def test_drawn_path_is_as_long_as_the_wires():
    """Straight parts, arcs and the way through the plates add up to (2) and (3)."""
    rng = np.random.default_rng(5)
    R, e = PARAMS.ball_radius, PARAMS.plate_thickness
    for _ in range(50):
        x = random_posture(rng)
        length = np.zeros(9)
        for ball, (centre, P, P_far) in enumerate(
            hanging_points(turns_of(x), x[0], PARAMS)
        ):
            B, C = tangent_points(centre, P, P_far, PARAMS)
            chord = np.linalg.norm(C - B, axis=1)
            direct = np.linalg.norm(P_far - P, axis=1)
            round_it = (
                np.linalg.norm(B - P, axis=1)
                + 2 * R * np.arcsin(chord / (2 * R))
                + np.linalg.norm(P_far - C, axis=1)
            )
            touching = direct > 2 * PARAMS.face
            on_ball = np.linalg.norm(B - centre, axis=1)[touching]
            np.testing.assert_allclose(on_ball, R, rtol=1e-12)
            length[list(wires_at(ball))] += np.where(touching, round_it, direct) + e
        np.testing.assert_allclose(length, wire_lengths(x, PARAMS), atol=1e-12)
        assert math.isfinite(length.sum())
