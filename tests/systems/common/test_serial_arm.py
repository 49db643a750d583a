"""The compiled kinematics against the plant that they are read from."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import JacobianWrtVariable
import pytest

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import POSITION_LIMIT
from plants.instruments.instrument import InstrumentParams
from systems.common.serial_arm import read_arm, tip_frame, tip_position, tool_state

PLANTS = {
    "usual": make_controller_plant(),
    "tilted": make_controller_plant(
        RigidTransform(RollPitchYaw(0.3, -0.2, 0.5), [0.1, 0.2, 0.3]),
        InstrumentParams(length=0.3, gauze_mass=0.05),
    ),
}


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("seed", range(5))
def test_tool_is_where_the_plant_says(name, seed):
    plant = PLANTS[name]
    tip = plant.GetFrameByName(INSTRUMENT_TIP)
    arm = read_arm(plant, tip)[0]
    q = np.random.default_rng(seed).uniform(-POSITION_LIMIT, POSITION_LIMIT)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_WT = tip.CalcPoseInWorld(context)
    world = plant.world_frame()
    J_plant = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kV, tip, np.zeros(3), world, world
    )
    p, u, J, weight = tool_state(arm, q)
    np.testing.assert_allclose(p, X_WT.translation(), atol=1e-12)
    np.testing.assert_allclose(u, X_WT.rotation().col(2), atol=1e-12)
    np.testing.assert_allclose(J, J_plant, atol=1e-12)
    expected = plant.CalcGravityGeneralizedForces(context)
    np.testing.assert_allclose(weight, expected, atol=1e-12)
    assert tip_position(arm, q) == p
    x, z = tip_frame(arm, q)[1:]
    np.testing.assert_allclose(x, X_WT.rotation().col(0), atol=1e-12)
    assert z == u
