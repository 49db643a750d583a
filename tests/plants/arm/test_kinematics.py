"""The arm's kinematics in floats against the plant's."""

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable
import pytest

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.kinematics import chain, flange_pose, payload_torque, tool_jacobian
from plants.arm.parameters import BASE_POSITION, POSITION_LIMIT
from plants.instruments.instrument import InstrumentParams


@pytest.fixture(scope="module")
def plant():
    return make_controller_plant()


@pytest.fixture(params=range(5))
def q(request):
    rng = np.random.default_rng(request.param)
    return rng.uniform(-POSITION_LIMIT, POSITION_LIMIT)


def test_stretched_arm_is_as_long_as_the_published_lengths():
    p, R = flange_pose([0.0] * 7)
    np.testing.assert_allclose(p, [0.0, 0.0, 0.317 + 0.45 + 0.48 + 0.07])
    np.testing.assert_allclose(R, np.eye(3))


def test_flange_pose_is_the_plants(plant, q):
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_WF = plant.GetFrameByName("flange").CalcPoseInWorld(context)
    p, R = flange_pose(q.tolist())
    np.testing.assert_allclose(p + BASE_POSITION, X_WF.translation(), atol=1e-9)
    np.testing.assert_allclose(R, X_WF.rotation().matrix(), atol=1e-9)


def test_joint_axes_are_the_plants(plant, q):
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    axes, _, _, _ = chain(q.tolist())
    for i, axis in enumerate(axes, start=1):
        R = plant.GetBodyByName(f"link{i}").EvalPoseInWorld(context).rotation()
        np.testing.assert_allclose(axis, R.col(2), atol=1e-9)


def test_jacobian_of_the_tip_is_the_plants(plant, q):
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    world = plant.world_frame()
    expected = plant.CalcJacobianSpatialVelocity(
        context,
        JacobianWrtVariable.kV,
        plant.GetFrameByName(INSTRUMENT_TIP),
        np.zeros(3),
        world,
        world,
    )
    J = tool_jacobian(q.tolist(), InstrumentParams().length)
    np.testing.assert_allclose(J, expected, atol=1e-9)


def test_payload_torque_carries_the_instrument(plant, q):
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    tool = InstrumentParams()
    torque = payload_torque(q.tolist(), tool.mass, tool.centre)
    weight = plant.CalcGravityGeneralizedForces(context)
    np.testing.assert_allclose(torque, -weight, atol=1e-9)


def test_wrong_number_of_joints_is_refused():
    with pytest.raises(ValueError, match=r"zip\(\) argument"):
        chain([0.0] * 6)
