"""Backward movement: equation (5)."""

from math import exp, nan

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from systems.auto_guidance import backward_movement as module
from systems.auto_guidance.backward_movement import (
    BackwardMovement,
    BackwardMovementParams,
)
from systems.common.signal import example, flat
from systems.common.signals import Estimate, Guide
from tests.loosely import loosely

backward_movement = loosely(module.backward_movement, module.constants)
contact_velocity = loosely(module.contact_velocity)
DT = 1.0 / 60.0
GUIDE, OBSTACLE = example(Guide), example(Estimate)
TIP_GUIDE = GUIDE._replace(l_over_L=1.0)
NOTHING = Estimate(*[(nan,) * 3] * 4, *[nan] * 5)


def moving(v):
    return OBSTACLE._replace(v=v)


def settle(params, v3, v, seconds):
    for _ in range(round(seconds / DT)):
        v3 = backward_movement(params, v3, DT, TIP_GUIDE, moving(v))
    return v3


def test_takes_up_the_obstacles_velocity_and_stops_with_it():
    params = BackwardMovementParams()
    v = (0.01, -0.04, 0.02)
    v3 = settle(params, (0.0, 0.0, 0.0), v, 1.0)
    np.testing.assert_allclose(v3, v, rtol=1e-6)
    v3 = settle(params, v3, (0.0, 0.0, 0.0), 1.0)
    assert np.linalg.norm(v3) < 1e-9


def test_the_time_constant_is_one_over_b():
    params = BackwardMovementParams(gain=5.0)
    v3 = settle(params, (0.0, 0.0, 0.0), (0.0, 0.04, 0.0), 0.2)
    assert v3[1] == pytest.approx(0.04 * (1 - exp(-1.0)))


def test_printed_form_grows_while_the_obstacle_moves_and_stays_when_it_stops():
    params = BackwardMovementParams(form="printed", gain=5.0)
    v3 = settle(params, (0.0, 0.0, 0.0), (0.0, 0.04, 0.0), 2.0)
    assert v3[1] == pytest.approx(5.0 * 0.04 * 2.0)
    assert settle(params, v3, (0.0, 0.0, 0.0), 2.0) == pytest.approx(v3)


def test_contact_velocity_is_that_of_the_material_point():
    # O hangs along -z; half way down it turns at half the speed, slides at all of it.
    obstacle = OBSTACLE._replace(p=(0, 0, -0.1), v=(0.04, 0, 0.02), fulcrum=(0, 0, 0))
    guide = GUIDE._replace(l_over_L=0.5)
    np.testing.assert_allclose(contact_velocity(guide, obstacle), (0.02, 0, 0.02))


@pytest.mark.parametrize(
    "obstacle",
    [NOTHING, OBSTACLE._replace(known=0.0, age=9.0), moving((nan, 0.0, 0.0))],
)
def test_dies_out_without_a_usable_obstacle(obstacle):
    params = BackwardMovementParams()
    v3 = backward_movement(params, (0.03, 0.0, 0.0), DT, TIP_GUIDE, obstacle)
    assert 0.0 < v3[0] < 0.03 and v3[1:] == (0.0, 0.0)


def test_block_output_is_the_step_that_its_update_makes():
    dut = BackwardMovement()
    context = dut.CreateDefaultContext()
    dut.GetInputPort("guide").FixValue(context, flat(GUIDE))
    dut.GetInputPort("obstacles").FixValue(context, flat(OBSTACLE))
    expected = backward_movement(
        BackwardMovementParams(), (0, 0, 0), DT, GUIDE, OBSTACLE
    )
    np.testing.assert_allclose(dut.GetOutputPort("v3").Eval(context), expected)
    Simulator(dut, context).AdvanceTo(0.5 * DT)
    np.testing.assert_allclose(
        context.get_discrete_state_vector().value(), [*expected, 0.0]
    )


@pytest.mark.parametrize(
    "change, message",
    [
        ({"form": "paper"}, "form='paper': expected one of corrected, printed"),
        ({"gain": -2.0}, r"backward_movement.gain=-2.0 1/s: expected > 0 and <= 1000"),
        ({"gain": 1e9}, r"gain=1000000000.0"),
        ({"period": 0.0}, r"period=0.0 s: expected > 0"),
    ],
)
def test_bad_parameters(change, message):
    with pytest.raises(ValueError, match=message):
        BackwardMovement(BackwardMovementParams(**change))
