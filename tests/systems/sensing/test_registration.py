"""Registration: the tracker's frame found from the robot's own tool."""

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from plants.arm.parameters import READY_POSTURE
from plants.arm.signals import ArmState
from systems.common.parameter import ParameterError
from systems.common.serial_arm import tip_frame
from systems.common.signal import flat, view
from systems.common.signals import Alignment, Shaft, TrackedShaft
from systems.sensing.optical_tracker import (
    MarkerNoise,
    OpticalTrackerParams,
    constants,
    disturb,
    misplaced,
)
from systems.sensing.registration import (
    Registration,
    RegistrationParams,
    moved_back,
)

SHIFT, TURN = (0.002, -0.003, 0.001), (0.01, -0.005, 0.017)


def play(seconds, seed):
    """The block beside an arm that moves: its alignment, and by how much it errs."""
    params = OpticalTrackerParams(shift=list(SHIFT), turn=list(TURN))
    record = constants(params.body, SHIFT, TURN)[0]
    rng = np.random.default_rng(seed)
    dut = Registration()
    context = dut.CreateDefaultContext()
    simulator = Simulator(dut, context)
    tool = Shaft((0.03, 0.02, -0.12), (0.0, 0.0, -1.0))
    frame = TrackedShaft((0.0,) * 3, (0.0, 0.0, -1.0), -1.0, 0.0)
    for k in range(round(seconds * 60)):
        time = k / 60
        swing = 0.1 * np.sin(2.0 * time)
        q = tuple(float(x + swing) for x in READY_POSTURE)
        for name, value in {
            "arm_state": ArmState(q, (0.0,) * 7),
            "robot_measured": frame,
            "target_measured": TrackedShaft(*misplaced(record, tool), time, 1.0),
            "obstacle_measured": frame,
        }.items():
            dut.GetInputPort(name).FixValue(context, flat(value))
        simulator.AdvanceTo(time + 0.5 / 60)
        p, _, u = tip_frame(dut._arm[0], np.array(q))
        noise = MarkerNoise(tuple(rng.normal(size=3)), tuple(rng.normal(size=3)))
        shown = misplaced(record, disturb(record, Shaft(p, u), noise))
        frame = TrackedShaft(*shown, time, 1.0)
    told = view(Alignment, np.array(dut.GetOutputPort("alignment").Eval(context)))
    seen = view(TrackedShaft, np.array(dut.GetOutputPort("target").Eval(context)))
    return told, np.linalg.norm(np.subtract(seen.tip, tool.tip))


@pytest.mark.parametrize("seed", [1, 2])
def test_millimetres_and_a_degree_are_mended_within_a_second(seed):
    told, off = play(1.0, seed)
    assert off < 3e-4 and off < 4.0 * told.sigma
    np.testing.assert_allclose(told.t, SHIFT, atol=3e-4)
    np.testing.assert_allclose(told.theta, TURN, atol=3e-3)
    assert told.residual < 5e-4


def test_what_cannot_be_seen_is_not_claimed():
    """Without a frame of its own tool it says how little it knows."""
    dut = Registration(RegistrationParams(first_shift=4e-3))
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    lost = TrackedShaft((0.0,) * 3, (0.0, 0.0, -1.0), -5.0, 1.0)
    dut.GetInputPort("robot_measured").FixValue(context, flat(lost))
    Simulator(dut, context).AdvanceTo(0.5)
    told = view(Alignment, np.array(dut.GetOutputPort("alignment").Eval(context)))
    assert told.sigma >= 4e-3 and not np.any(told.t)


def test_a_frame_is_moved_back_to_a_micrometre():
    params = OpticalTrackerParams(shift=list(SHIFT), turn=list(TURN))
    record = constants(params.body, SHIFT, TURN)[0]
    tool = Shaft((0.05, 0.03, -0.12), (0.6, 0.0, -0.8))
    frame = TrackedShaft(*misplaced(record, tool), 0.0, 1.0)
    back = moved_back(np.array([*SHIFT, *TURN]), frame)
    np.testing.assert_allclose(back.tip, tool.tip, atol=5e-6)
    np.testing.assert_allclose(back.u, tool.u, atol=5e-4)


def test_bad_parameters_are_named():
    with pytest.raises(ParameterError, match=r"first_shift=1.0 m: expected"):
        Registration(RegistrationParams(first_shift=1.0))
