"""Tests of the navigation monitor against readings made from a wall's own law."""

import numpy as np
import pytest

from systems.common.parameter import ParameterError
from systems.common.signal import example, flat, vector, view
from systems.common.signals import Fulcrum, Permission, ShaftMotion, Wrench
from systems.common.stops import Stop
from systems.passive_wrist.navigation_monitor import (
    Accuracy,
    Doubt,
    NavigationMonitor,
    NavigationMonitorParams,
)

SAMPLE, DEPTH, K = 1 / 120, 0.25, 500.0
FROM = 240
"""Sample from which something is wrong."""


def said(seed, n=480, off=0.0, told=0.0, bias=0.0, valid=1.0, stop=Stop.MOVING):
    """What the block says, the fault from `FROM` on.

    Args:
        seed: Of the sensor's noise.
        n: Number of readings.
        off: The shaft passes the fulcrum by so much, m.
        told: The estimate is wrong by so much, across the shaft, m.
        bias: Of the force alone, N.
        valid: Of the readings.
        stop: Why the wrist lets the task stand.
    """
    dut = NavigationMonitor()
    context = dut.CreateDefaultContext()
    rng = np.random.default_rng(seed)
    u, rows = np.array([0.0, 0.0, -1.0]), []
    shaft = ShaftMotion((0.0, 0.0, DEPTH), vector(u), (0.0,) * 3, (0.0,) * 3)
    for k in range(n):
        on = float(k >= FROM)
        true = K * np.array([on * off, 0.0, 0.0])
        f = true + 0.05 * rng.standard_normal(3) + [0.0, on * bias, 0.0]
        m = DEPTH * np.cross(u, true) + 0.005 * rng.standard_normal(3)
        felt = Wrench(vector(f), vector(m), valid if on else 1.0)
        p = (on * (off + told), 0.0, 0.0)
        known = example(Fulcrum)._replace(p=p, stiffness=K)
        code = float(stop) if on else 0.0
        inputs = {"shaft": shaft, "wrench": felt, "estimate": known}
        inputs["permission"] = Permission(1.0 - on * (code > 0.0), code)
        for name, value in inputs.items():
            dut.GetInputPort(name).FixValue(context, flat(value))
        rows.append(np.array(dut.GetOutputPort("accuracy").Eval(context)))
        new = dut.EvalUniquePeriodicDiscreteUpdate(context).value()
        context.SetDiscreteState(np.array(new))
    return view(Accuracy, np.array(rows))


@pytest.mark.parametrize("seed", range(5))
def test_what_is_accurate_is_said_to_be(seed):
    told = said(seed)
    assert (told.doubt[:20] == Doubt.UNSURE).all()  # before it has heard anything
    assert told.accurate[30:].all() and not told.alarms.any()


@pytest.mark.parametrize(
    ("fault", "doubt", "within"),
    [
        ({"off": 0.004}, Doubt.LOAD, 0.05),
        ({"off": 0.0013}, Doubt.LOAD, 0.4),
        ({"told": 0.005}, Doubt.GAP, 0.03),
        ({"told": -0.001}, Doubt.GAP, 0.15),
        ({"bias": 0.3}, Doubt.MISMATCH, 0.3),
        ({"valid": 0.0}, Doubt.SILENT, 0.06),
    ],
)
def test_each_fault_is_noticed_in_time_by_its_name(fault, doubt, within):
    for seed in range(5):
        told = said(seed, **fault)
        assert told.accurate[30:FROM].all()
        first = int(np.argmax(told.accurate[FROM:] < 0.5))
        assert 0 < (first + 1) * SAMPLE <= within
        assert told.doubt[-1] == doubt and told.alarms[-1] == 1.0


def test_half_a_bound_is_no_alarm():
    bounds = NavigationMonitorParams()
    assert not said(1, off=0.5 * bounds.load / K).alarms.any()
    assert not said(1, told=0.5 * bounds.gap / K).alarms.any()
    assert not said(1, bias=0.5 * bounds.mismatch).alarms.any()


def test_a_probe_is_no_alarm_and_not_accurate():
    told = said(1, off=0.002, stop=Stop.PROBING)
    assert (told.doubt[FROM:] == Doubt.PROBING).all() and not told.alarms.any()
    assert not told.accurate[FROM:].any()


def test_a_bound_of_nothing_is_refused():
    with pytest.raises(ParameterError, match=r"navigation_monitor.gap=0.0 N: .*> 0"):
        NavigationMonitor(NavigationMonitorParams(gap=0.0))
