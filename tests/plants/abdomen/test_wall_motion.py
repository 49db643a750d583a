"""The wall's motion: waves, step, insufflation, bad input."""

import numpy as np
import pytest

from diagrams.common.run import simulate
from diagrams.studies import load_scenario
from plants.abdomen.wall_motion import WallMotionParams, wave
from systems.common.parameter import check


@pytest.mark.parametrize("kind", ["sine", "ventilator"])
def test_waves_are_continuous_and_within_bounds(kind):
    breaths = np.linspace(0.0, 3.0, 30001)
    g = np.array([wave(kind, b) for b in breaths])
    assert g.max() <= 1.0 + 1e-12 and g.min() >= -1.0 - 1e-12
    assert np.abs(np.diff(g)).max() < 2e-3
    np.testing.assert_allclose(g[:10001], g[20000:], atol=1e-6)


def test_ventilator_breathes_in_for_two_fifths():
    g = np.array([wave("ventilator", b) for b in np.linspace(0.0, 1.0, 1001)])
    assert g.argmax() == pytest.approx(400, abs=1)
    slope = np.diff(g)
    assert -slope.min() > 1.5 * slope.max()  # sharp out, smooth in


def test_the_wall_steps_in_about_20_ms():
    run = simulate(load_scenario("pwe_step", duration=5.1))
    t, x = run.signals["time"], run.wall.fulcrum.p[:, 0]
    after = t > 5.0 + 0.5 / 120.0
    assert x[t < 5.0].max() < 1e-6
    assert np.interp(5.025, t[after], x[after]) > 0.95 * 0.018
    assert x.max() < 0.0185


def test_insufflation_lifts_and_stiffens():
    motion = WallMotionParams(
        rise=[0.0, 0.0, 0.012], rise_time=2.0, rise_duration=5.0, stiffening=0.4
    )
    assert motion.displacement(2.0) == [0.0, 0.0, 0.0]
    assert motion.displacement(7.0)[2] == pytest.approx(0.012)
    assert motion.stiffness_factor(4.5) == pytest.approx(1.2)
    assert not motion.still and WallMotionParams().still


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"wave": "square"},
            "wall_motion.wave='square': expected one of sine, ventilator",
        ),
        (
            {"breathing": [0.2, 0.0, 0.0]},
            "breathing=.* m: expected 3 numbers >= -0.05 and <= 0.05",
        ),
        ({"breathing": [float("nan"), 0.0, 0.0]}, "breathing="),
        ({"rate": 0.0}, "rate=0.0 Hz"),
        ({"stiffening": -1.0}, "stiffening=-1.0"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ValueError, match=message):
        check(WallMotionParams(**change))
