"""Tests of wires that carry signals wrongly."""

import numpy as np
import pytest

from plants.faults.fault import KINDS, Fault
from plants.faults.faulty_wire import BREAKS, FaultyWire
from systems.common.parameter import ParameterError
from systems.common.signal import example, flat, view
from systems.common.signals import Fulcrum, TrackedShaft, Wrench

SAMPLE = 1 / 120


def told(fault, signal, samples, value):
    """What a wire tells at each sample of what `value(k)` is."""
    dut = FaultyWire(fault, signal)
    context = dut.CreateDefaultContext()
    rows = []
    for k in range(samples):
        dut.GetInputPort("whole").FixValue(context, np.asarray(value(k), float))
        rows.append(np.array(dut.GetOutputPort("told").Eval(context)))
        new = np.array(dut.EvalUniquePeriodicDiscreteUpdate(context).value())
        context.SetDiscreteState(new)
        context.SetTime((k + 1) * SAMPLE)
    return np.array(rows)


def wrench(k):
    return flat(Wrench((1.0 + k, 2.0, 3.0), (0.1, 0.2, 0.3 + k), 1.0))


@pytest.mark.parametrize("kind", [k for k in KINDS if k.startswith("force")])
def test_what_is_told(kind):
    fault = Fault(kind, start=2 * SAMPLE, duration=3 * SAMPLE, size=5.0)
    rows = told(fault, Wrench, 8, wrench)
    whole = np.array([wrench(k) for k in range(8)])
    np.testing.assert_array_equal(rows[:2], whole[:2])
    np.testing.assert_array_equal(rows[5:], whole[5:])
    during, true = view(Wrench, rows[2:5]), view(Wrench, whole[2:5])
    expected = {
        "force_stuck": [1.0 + 1, 2.0, 3.0],
        "force_flipped": -true.f,
        "force_bias": true.f + [5.0, 0.0, 0.0],
        "force_silent": 0.0 * true.f,
    }
    np.testing.assert_array_equal(during.f, np.broadcast_to(expected[kind], (3, 3)))
    np.testing.assert_array_equal(during.valid, 0.0 if kind == "force_silent" else 1.0)


def test_it_lasts_from_the_sample_at_its_start():
    rows = told(
        Fault("tension_nan", start=0.0, duration=SAMPLE), 2, 3, lambda k: [k, k]
    )
    np.testing.assert_array_equal(np.isnan(rows).any(axis=1), [True, False, False])


def test_a_frame_from_the_future():
    frame = flat(TrackedShaft((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.0, 1.0))
    fault = Fault("frame_future", duration=1.0, size=100.0)
    rows = view(TrackedShaft, told(fault, TrackedShaft, 3, lambda k: frame))
    np.testing.assert_array_equal(rows.time, [100.0, 100.0, 100.0])
    np.testing.assert_array_equal(rows.valid, 1.0)


def test_a_slow_arm_moves_no_faster():
    rows = told(
        Fault("arm_slow", duration=1.0, size=0.6), 2, 5, lambda k: [k > 0, 0.001]
    )
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.6 * SAMPLE)
    np.testing.assert_allclose(rows[1:, 1], 0.001)


@pytest.mark.parametrize(
    ("kind", "off"),
    [("fulcrum_aside", [0.005, 0.0, 0.0]), ("fulcrum_deep", [0.0, 0.0, 0.005])],
)
def test_an_estimate_that_is_wrong(kind, off):
    true = flat(example(Fulcrum))
    rows = told(Fault(kind, duration=1.0, size=0.005), Fulcrum, 2, lambda k: true)
    np.testing.assert_allclose(view(Fulcrum, rows).p - view(Fulcrum, true).p, [off] * 2)
    assert (rows != true).sum() == 2


def test_an_unknown_kind_is_named():
    with pytest.raises(ParameterError, match=r"faults.kind='stuck'.*force_stuck"):
        FaultyWire(Fault("stuck"))


def test_every_kind_breaks_something():
    assert set(KINDS) == set(BREAKS)
