"""The snake's weight against the plant's."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
import pytest

from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.snake import FAR, NEAR, add_snake
from plants.snake.weight import weight


@pytest.mark.parametrize("gravity", [[0.0, 0.0, -9.81], [3.0, -5.0, 2.0]])
def test_weight_is_the_plants(gravity):
    plant = MultibodyPlant(0.0)
    add_snake(plant, plant.world_frame())
    plant.mutable_gravity_field().set_gravity_vector(gravity)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for _ in range(20):
        x = np.append(0.02, rng.uniform(-0.5, 0.5, 6))
        q = np.zeros(plant.num_positions())
        q[NEAR], q[FAR] = x, x[1:]
        plant.SetPositions(context, q)
        forces = plant.CalcGravityGeneralizedForces(context)
        expected = forces[NEAR].copy()
        expected[1:] += forces[FAR]  # each coupler makes the far ball follow
        found = weight(x, SnakeParams(), SnakeDriveParams(), gravity)
        np.testing.assert_allclose(found, expected, atol=1e-12)
