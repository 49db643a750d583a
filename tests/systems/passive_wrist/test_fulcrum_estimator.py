"""The estimator's block: once an instant, and no NaN gets in."""

import numpy as np
import pytest

from systems.common.signal import flat, view
from systems.common.signals import Fulcrum, ShaftMotion, Wrench
from systems.passive_wrist.fulcrum_estimator import FulcrumEstimator
from systems.passive_wrist.fulcrum_filter import FulcrumParams

STILL = (0.0, 0.0, 0.0)
SHAFT = ShaftMotion((0.0, 0.0, 0.22), (0.0, 0.0, -1.0), STILL, STILL)


def evaluate(dut, wrench, time=0.0, context=None):
    context = context or dut.CreateDefaultContext()
    context.SetTime(time)
    dut.GetInputPort("shaft").FixValue(context, flat(SHAFT))
    dut.GetInputPort("wrench").FixValue(context, flat(wrench))
    return context, view(Fulcrum, dut.GetOutputPort("estimate").Eval(context).copy())


def test_first_reading_puts_the_guess_on_its_line():
    dut = FulcrumEstimator(FulcrumParams(guess=[0.012, 0.0, 0.02], stiffness=500.0))
    _, e = evaluate(dut, Wrench((1.0, 0.0, 0.0), (0.0, 0.2, 0.0), 1.0))
    np.testing.assert_allclose(e.p, [0.002, 0.0, 0.02], atol=1e-12)


def test_an_instant_counts_once():
    dut = FulcrumEstimator()
    context, first = evaluate(dut, Wrench((0.4, 0.0, 0.0), (0.0, -0.088, 0.0), 1.0))
    update = dut.EvalUniquePeriodicDiscreteUpdate(context)
    context.SetDiscreteState(update)
    _, again = evaluate(dut, Wrench((9.0, 9.0, 0.0), STILL, 1.0), 0.0, context)
    # The state's, not the new reading's.
    np.testing.assert_array_equal(flat(first), flat(again))


def test_nan_or_silence_leaves_the_estimate_finite_and_less_sure():
    dut = FulcrumEstimator()
    context, before = evaluate(dut, Wrench((0.1, 0.0, 0.0), (0.0, -0.02, 0.0), 1.0))
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))
    hole = (float("nan"),) * 3
    for wrench in (Wrench(hole, hole, 1.0), Wrench(STILL, STILL, 0.0)):
        _, after = evaluate(dut, wrench, 1.0 / 120.0, context)
        assert np.isfinite(flat(after)).all()
        np.testing.assert_allclose(after.p, before.p, atol=1e-12)
        assert after.sigma_across > before.sigma_across
        assert after.sigma_along > before.sigma_along


@pytest.mark.parametrize("harmonics", [1, 3])
def test_covariance_belongs_to_the_sigmas(harmonics):
    dut = FulcrumEstimator(FulcrumParams(harmonics=harmonics))
    context, e = evaluate(dut, Wrench((0.4, 0.1, 0.0), (0.0, -0.088, 0.0), 1.0))
    P = dut.GetOutputPort("covariance").Eval(context).reshape(3, 3)
    np.testing.assert_allclose(P, P.T)
    along = SHAFT.u @ P @ SHAFT.u
    assert np.sqrt(along) == pytest.approx(e.sigma_along)
    across = np.sqrt(0.5 * (np.trace(P) - along))
    assert across == pytest.approx(e.sigma_across)
