"""The breathing rate is found within little more than a breath, and not its half."""

import numpy as np
import pytest

from plants.abdomen.wall_motion import wave
from systems.passive_wrist.breathing_rate import find_breathing

PERIOD = 0.1


def record(kind: str, rate: float, length: float, phase: float, noise: float):
    """A wall that breathes along one line, 6 mm peak to peak."""
    rng = np.random.default_rng(round(1e4 * (rate + phase)))
    t = np.arange(0.0, length, PERIOD)
    g = np.array([wave(kind, rate * x + phase) for x in t])
    way = np.array([0.6, 0.0, 0.8])
    return 0.003 * g[:, None] * way + noise * rng.normal(size=(len(t), 3))


@pytest.mark.parametrize("kind", ["sine", "ventilator"])
@pytest.mark.parametrize("rate", [0.15, 0.2, 0.25, 0.3, 0.35])
def test_rate_after_a_breath_and_a_half(kind, rate):
    for phase in (0.0, 0.3, 0.7):
        fit = find_breathing(record(kind, rate, 1.5 / rate, phase, 5e-5), PERIOD, 2)
        assert fit is not None
        assert fit.rate == pytest.approx(rate, rel=0.06)


@pytest.mark.parametrize("kind", ["sine", "ventilator"])
def test_half_the_rate_is_never_taken_on_a_long_record(kind):
    for rate in np.linspace(0.15, 0.35, 21):
        fit = find_breathing(record(kind, rate, 12.0, 0.1, 5e-5), PERIOD, 2)
        assert fit is not None
        assert fit.rate == pytest.approx(rate, rel=0.02)


def test_size_and_what_is_left():
    fit = find_breathing(record("sine", 0.2, 10.0, 0.0, 1e-6), PERIOD, 2)
    assert fit is not None
    assert fit.amplitude == pytest.approx(0.003 / np.sqrt(2.0), rel=0.02)
    assert fit.residual < 2e-5
    np.testing.assert_allclose(fit.parts, [0.003 / np.sqrt(2.0), 0.0], atol=2e-5)


def test_nothing_in_half_a_breath():
    short = record("sine", 0.15, 3.0, 0.0, 1e-6)
    fit = find_breathing(short, PERIOD, 2)
    assert fit is None or fit.rate * 3.0 >= 0.97
