"""Test of the robot's location against the plant's own kinematics."""

import numpy as np
import pytest

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.instrument import InstrumentParams
from systems.common.signal import view
from systems.common.signals import RobotTool
from systems.sensing.robot_location import RobotLocation


@pytest.mark.parametrize("length", [0.40, 0.33])
def test_tip_from_the_measured_joints(length):
    instrument = InstrumentParams(length=length)
    dut = RobotLocation(instrument)
    plant = make_controller_plant(instrument=instrument)
    plant_context = plant.CreateDefaultContext()
    context = dut.CreateDefaultContext()
    dut.GetInputPort("fulcrum").FixValue(context, [0.01, 0.02, 0.03])
    for shift in (0.0, 0.1, -0.2):
        q = np.array(READY_POSTURE) + shift
        dut.GetInputPort("arm_state").FixValue(context, [*q, *[0.5] * 7])
        plant.SetPositions(plant_context, q)
        tip = plant.GetFrameByName(INSTRUMENT_TIP).CalcPoseInWorld(plant_context)
        tool = view(RobotTool, dut.GetOutputPort("robot_tool").Eval(context))
        np.testing.assert_allclose(tool.fulcrum, [0.01, 0.02, 0.03])
        np.testing.assert_allclose(tool.tip, tip.translation(), atol=1e-12)
