"""The sensor's drift: told from the wall by moment and roll."""

from math import cos, pi, sin

import numpy as np
import pytest

from plants.instruments.wrist_sensor import Mount
from systems.common.signal import example, flat, size, vector, view
from systems.common.signals import Wrench
from systems.passive_wrist.sensor_zero import (
    COMMON,
    MEMORY,
    SensorZero,
    SensorZeroing,
    SensorZeroParams,
    Told,
)

K, PERIOD, DEPTH, ROLL = 500.0, 0.1, 0.3, 2.1
APART, TRUE = 0.10 - 0.06j, 0.05 + 0.08j


def complex_of(v) -> complex:
    return complex(v[0], v[1])


def played(seconds, drift=0.0, jump=0.0, roll=ROLL, **params):
    """The block beside an estimator that is off by what it is not told of the bias.

    The wall breathes by 5 mm, drifts [m/s], and jumps in mid-time [m].
    """
    dut = SensorZeroing(SensorZeroParams(period=PERIOD, **params))
    x, y = (dut._constants[0][name] for name in ("x_axis", "y_axis"))
    context = dut.CreateDefaultContext()
    memory = context.get_discrete_state(0).value().copy()
    told = flat(Told((0.0, 0.0, 0.0), K, 0.0, 0.0))
    zeros = []
    for k in range(round(seconds / PERIOD)):
        t = k * PERIOD
        phi = 0.5 * roll * (1.0 - cos(2.0 * pi * t / 60.0))
        across = cos(phi) * x + sin(phi) * y, cos(phi) * y - sin(phi) * x
        mount = example(Mount)._replace(
            p=(0.0, 0.0, DEPTH), x=vector(across[0]), y=vector(across[1])
        )
        R = np.column_stack([*across, mount.z])
        force, torque = APART + TRUE, DEPTH * TRUE
        f = R @ [force.real, force.imag, 0.0]
        m = R @ [-torque.imag, torque.real, 0.0]
        wrench = Wrench(vector(f), vector(m), 1.0)
        out = dut._run(dut._constants, memory, told, flat(mount), flat(wrench))
        memory, zero = out[:MEMORY], view(SensorZero, out[-size(SensorZero) :])
        left = (TRUE - complex_of(zero.common)) * complex(cos(phi), sin(phi)) / K
        left += drift * t + jump * (t > 0.5 * seconds)
        left += 0.005 * sin(0.5 * pi * t)
        told = flat(Told(vector(left.real * x + left.imag * y), K, 0.25, 1.0))
        zeros.append(zero)
    return zeros


def test_what_force_and_moment_disagree_by_is_the_forces():
    last = played(120.0, common=False)[-1]
    assert complex_of(last.apart) == pytest.approx(APART, abs=2e-3)
    assert not np.any(last.common)


@pytest.mark.parametrize(("drift", "jump"), [(0.0, 0.0), (1e-5, 0.0), (0.0, 0.015)])
def test_a_rolled_sensor_tells_its_bias_from_the_wall(drift, jump):
    zeros = played(300.0, drift, jump)
    off = [abs(complex_of(zero.common) - TRUE) for zero in zeros]
    assert off[-1] < 0.01
    assert max(off[len(off) // 2 :]) < 0.04
    assert zeros[-1].sigma < 0.015


def test_a_breath_alone_is_no_bias():
    """Without a roll the prior holds."""
    zeros = played(120.0, roll=0.0)
    assert abs(complex_of(zeros[-1].common)) < 0.01


def test_a_broken_reading_is_passed_on_and_nothing_learnt():
    dut = SensorZeroing()
    context = dut.CreateDefaultContext()
    memory = context.get_discrete_state(0).value().copy()
    memory[2 * COMMON] = 0.1
    told = context.get_discrete_state(1).value()
    broken = flat(Wrench((np.nan, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0))
    out = dut._run(dut._constants, memory, told, flat(example(Mount)), broken)
    np.testing.assert_array_equal(out[:MEMORY], memory)
    np.testing.assert_array_equal(out[MEMORY : MEMORY + size(Wrench)], broken)
