"""Hysteresis compensation, the tracked tool and what opposes its motion, as blocks."""

import math

import numpy as np
import pytest

from plants.snake.balls import tool_pose, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.statics import Statics
from systems.resection.wires.hysteresis_compensation import (
    HysteresisCompensation,
    HysteresisCompensationParams,
    aimed,
)
from systems.resection.wires.tool_load import (
    ToolLoad,
    ToolLoadParams,
    resisting,
)
from systems.resection.wires.tool_tracker import ToolTracker, ToolTrackerParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams

PARAMS, DRIVE, CORE = SnakeParams(), SnakeDriveParams(), SnakeCoreParams()
ROUGH = SnakeFrictionParams(0.1, 0.1)
WOUND = WireInverseActuationParams(least_tension=0.5)


def swing():
    """Modules bend one way and half-way back, and stay there, (n, 7)."""
    beta = 0.25 * np.sin(np.append(np.linspace(0, 2.6, 30), [2.6] * 20))
    bends = np.zeros((len(beta), 7))
    bends[:, 1::2], bends[:, 2::2] = (0.3, 1.0, 2.0), beta[:, None] * [1.0, 0.8, 1.2]
    return posture_of(bends)


def tick(dut, context):
    new = dut.EvalUniquePeriodicDiscreteUpdate(context)
    for i in range(context.num_discrete_state_groups()):
        context.SetDiscreteState(i, np.array(new.get_vector(i).value()))
    context.SetTime(context.get_time() + 0.02)


def errors(own, tracked=False, load=0.0, cutting=0.0):
    """Of the tool in m, wound for by a model of its own friction and tissue."""
    params = HysteresisCompensationParams(friction=own, cutting=cutting)
    dut = HysteresisCompensation(params, WOUND, PARAMS, DRIVE, CORE)
    context = dut.CreateDefaultContext()
    snake = Statics(PARAMS, DRIVE, CORE, friction=ROUGH)
    turns, grip, off, seen = turns_of(np.zeros(7)), None, [], None
    force, place = np.zeros(3), forward(np.zeros(7), PARAMS)[:3, 3]
    for x in swing():
        dut.GetInputPort("posture").FixValue(context, x)
        if tracked and seen is not None:
            dut.GetInputPort("measured").FixValue(context, seen)
        drums = dut.GetOutputPort("drums").Eval(context)
        found = snake.equilibrium(turns, wound=drums[:9], force=force, grip=grip)
        turns, grip = found.turns, found.grip
        X_WT = tool_pose(turns, drums[9], PARAMS)
        force = resisting(force, X_WT[:3, 3] - place, 60.0, load)
        place = X_WT[:3, 3]
        tick(dut, context)
        seen = [*X_WT[:3, 3], *X_WT[:3, 2], context.get_time()]
        off.append(np.linalg.norm(X_WT[:3, 3] - forward(x, PARAMS)[:3, 3]))
    return np.array(off)


def test_a_right_model_takes_the_error_away_and_tracking_helps_a_wrong_one():
    none, wrong, right = (
        errors(SnakeFrictionParams(mu, mu)) for mu in (0.0, 0.07, 0.1)
    )
    assert right.max() < 0.3 * none.max()
    assert right.max() < wrong.max() < 0.5 * none.max()
    tracked = errors(SnakeFrictionParams(), tracked=True)
    assert tracked[-1] < 0.3 * none[-1]


def test_a_model_that_draws_tissue_along_knows_the_force_when_the_tool_turns_back():
    none, known = (errors(ROUGH, load=0.3, cutting=own) for own in (0.0, 0.3))
    assert known.max() < 0.3 * none.max()
    assert known[-1] < 0.3 * none[-1]  # it stands, and tissue still pulls


def test_a_posture_is_moved_as_far_as_the_tool_is_off():
    x = posture_of([0.01, 0.4, 0.3, -1.2, 0.3, 2.5, 0.3])
    off = np.array([1e-4, -5e-5, 8e-5, 0.0, 0.0, 0.0])
    h, tool = PARAMS.half_pitch, PARAMS.tool_offset
    step = aimed(x, off, 0 * x, h, tool)
    moved = forward(x + step, PARAMS) - forward(x, PARAMS)
    np.testing.assert_allclose(moved[:3, 3], off[:3], atol=3e-6)
    # What moves no tool leads the body back.
    astray = 0.01 * redundant(x)
    led = aimed(x, 0 * off, astray, h, tool)
    np.testing.assert_allclose(led, astray, atol=2e-4)


def redundant(x):
    """A unit vector along which a posture leaves the tool's pose as it is."""
    pose = [np.ravel(forward(x + d, PARAMS)[:3, 2:]) for d in 1e-6 * np.eye(7)]
    J = (np.array(pose) - np.ravel(forward(x, PARAMS)[:3, 2:])) / 1e-6
    return np.linalg.svd(J.T)[2][-1]


@pytest.mark.parametrize("port", ["posture", "measured"])
def test_what_is_no_number_moves_no_drum(port):
    dut = HysteresisCompensation(wound=WOUND)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("posture").FixValue(context, np.zeros(7))
    for _ in range(2):
        drums = np.array(dut.GetOutputPort("drums").Eval(context))
        tick(dut, context)
    size = dut.GetInputPort(port).size()
    dut.GetInputPort(port).FixValue(context, [math.nan] * size)
    again = dut.GetOutputPort("drums").Eval(context)
    np.testing.assert_allclose(again, drums, atol=2e-6)


def test_a_tracker_is_late_and_errs():
    dut = ToolTracker(ToolTrackerParams(latency=0.06))
    context = dut.CreateDefaultContext()
    told = []
    for k in range(6):
        pose = [1e-3 * k, 0.0, 0.04, 0.0, 0.0, 1.0]
        dut.GetInputPort("tool").FixValue(context, pose)
        noise = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        dut.GetInputPort("noise").FixValue(context, noise)
        told.append(np.array(dut.GetOutputPort("measured").Eval(context)))
        tick(dut, context)
    assert told[2][6] == -1.0
    # Frame 2, exposed at 0.04 s, is there three periods later.
    assert told[5][6] == pytest.approx(0.04)
    sigma = 0.1e-3 / math.sqrt(3)
    np.testing.assert_allclose(told[5][:3], [2e-3 + sigma, 0.0, 0.04], atol=1e-12)
    assert math.acos(told[5][5]) == pytest.approx(math.radians(0.5), rel=1e-3)


def test_cutting_resists_until_tissue_gives_way():
    dut = ToolLoad(ToolLoadParams(cutting=0.3, tissue=60.0))
    context = dut.CreateDefaultContext()
    told = []
    for y in (0.0, 1e-3, 10e-3, 8e-3, math.nan):
        dut.GetInputPort("tool").FixValue(context, [0.0, y, 0.04, 0.0, 0.0, 1.0])
        tick(dut, context)
        told.append(dut.GetOutputPort("force").Eval(context).tolist())
    # Drawn along by 1 mm; cut; let go of by 2 mm; a place that is none says nothing.
    assert [f[1] for f in told] == pytest.approx([0.0, -0.06, -0.3, -0.18, -0.18])
    assert all(f[0] == f[2] == 0.0 for f in told)
