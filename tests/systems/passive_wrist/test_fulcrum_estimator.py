"""The estimator's block: once an instant, and no NaN gets in."""

import numpy as np

from systems.passive_wrist.fulcrum_estimator import FulcrumEstimator, FulcrumParams

SHAFT = [0.0, 0.0, 0.22, 0.0, 0.0, -1.0, *[0.0] * 6]


def evaluate(dut, wrench, time=0.0, context=None):
    context = context or dut.CreateDefaultContext()
    context.SetTime(time)
    dut.GetInputPort("shaft").FixValue(context, SHAFT)
    dut.GetInputPort("wrench").FixValue(context, wrench)
    return context, dut.GetOutputPort("estimate").Eval(context)


def test_first_reading_puts_the_guess_on_its_line():
    dut = FulcrumEstimator(FulcrumParams(guess=[0.012, 0.0, 0.02], stiffness=500.0))
    _, e = evaluate(dut, [1.0, 0.0, 0.0, 0.0, 0.2, 0.0, 1.0])
    np.testing.assert_allclose(e[:3], [0.002, 0.0, 0.02], atol=1e-12)


def test_an_instant_counts_once():
    dut = FulcrumEstimator()
    context, first = evaluate(dut, [0.4, 0.0, 0.0, 0.0, -0.088, 0.0, 1.0])
    update = dut.EvalUniquePeriodicDiscreteUpdate(context)
    context.SetDiscreteState(update)
    _, again = evaluate(dut, [9.0, 9.0, 0.0, 0.0, 0.0, 0.0, 1.0], 0.0, context)
    np.testing.assert_array_equal(first, again)  # the state's, not the new reading's


def test_nan_or_silence_leaves_the_estimate_finite_and_less_sure():
    dut = FulcrumEstimator()
    context, before = evaluate(dut, [0.1, 0.0, 0.0, 0.0, -0.02, 0.0, 1.0])
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))
    for wrench in ([float("nan")] * 6 + [1.0], [0.0] * 7):
        _, after = evaluate(dut, wrench, 1.0 / 120.0, context)
        assert np.isfinite(after).all()
        np.testing.assert_allclose(after[:3], before[:3], atol=1e-12)
        assert after[6] > before[6] and after[7] > before[7]
