"""The organ's estimate against its true motion."""

import numpy as np
import pytest

from plants.abdomen.breath import COUGH, Irregular
from plants.abdomen.organ_motion import OrganMotionParams
from plants.abdomen.wall_motion import WallMotionParams
from systems.sensing.organ_estimator import (
    FRAMES,
    OFFSET,
    SIZE,
    TIME,
    OrganEstimator,
    OrganEstimatorParams,
    constants,
    follow,
    report,
)

RATE, LATENCY, NOISE = 60.0, 1.0 / 30.0, 1e-4
REST = np.array([0.0, 0.0, -0.12])


def estimated(
    duration: float, wave: str = "sine", seed: int = 5, **irregular
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, errors (n, 3) in m, and the reports (n, 9), from frames with noise."""
    irregular["seed"] = irregular.pop("seed_", 0)
    wall = WallMotionParams(rate=0.25, wave=wave, irregular=Irregular(**irregular))
    organ = OrganMotionParams(breathing=[0.005, 0.0, 0.008], cough=[0.0, 0.0, 0.008])
    rng = np.random.default_rng(seed)
    dut = OrganEstimator(OrganEstimatorParams())
    c, z = constants(OrganEstimatorParams()), np.zeros(SIZE)
    z[TIME] = -1.0
    times, errors, reports = [], [], []
    for k in range(round(duration * RATE)):
        p = REST + organ.displacement(k / RATE, wall)
        seen = p + NOISE * rng.standard_normal(3)
        z = follow(c, z, np.array([*seen, 0.0, 0.0, -1.0, k / RATE, 1.0]))
        if z[FRAMES] >= 480 and z[FRAMES] % 60 == 0:
            dut.look(z)
        now = k / RATE + LATENCY
        told = report(z, now)
        times.append(now)
        errors.append(told[:3] - REST - organ.displacement(now, wall))
        reports.append(told)
    assert z[OFFSET] != 0.0
    return np.array(times), np.array(errors), np.array(reports)


@pytest.mark.parametrize(
    ("wave", "rms", "most"), [("sine", 0.06, 0.17), ("ventilator", 0.07, 0.4)]
)
def test_a_breath_is_learnt(wave, rms, most):
    for seed in (5, 6):
        times, errors, reports = estimated(60.0, wave, seed)
        distance = 1e3 * np.linalg.norm(errors, axis=1)[times > 25.0]
        assert np.sqrt((distance**2).mean()) < rms
        assert distance.max() < most
        assert times[np.argmax(reports[:, 7] > 0.5)] < 13.0
        assert not reports[:, 8].any()


@pytest.mark.parametrize(("wave", "rms"), [("sine", 0.2), ("ventilator", 0.3)])
def test_breaths_that_differ_are_no_alarm(wave, rms):
    """Breaths 5 % longer or shorter, deeper or shallower; a cough among them is one."""
    for seed in (21, 22):
        times, errors, reports = estimated(60.0, wave, seed, jitter=0.05, seed_=seed)
        distance = 1e3 * np.linalg.norm(errors, axis=1)[times > 25.0]
        assert np.sqrt((distance**2).mean()) < rms
        assert reports[times > 25.0, 8].mean() < 0.05
    times, _, reports = estimated(
        46.0, wave, jitter=0.05, seed_=21, coughs=[40.0 + 1 / 60]
    )
    assert not reports[(times > 30.0) & (times < 40.0), 8].any()
    assert 40.0 < times[(times > 30.0) & (reports[:, 8] > 0.5)][0] < 40.16


def test_a_cough_is_noticed_and_the_breath_found_again():
    times, errors, reports = estimated(50.0, coughs=[30.0])
    alarm = times[reports[:, 8] > 0.5]
    assert 30.0 < alarm[0] < 30.2
    assert alarm[-1] < 30.0 + COUGH + 3.0
    late = np.linalg.norm(errors, axis=1)[times > 36.0]
    assert np.sqrt((late**2).mean()) < 6e-5


def test_a_held_breath_is_noticed_and_followed():
    times, errors, reports = estimated(60.0, holds=[30.0, 40.0])
    alarm = times[reports[:, 8] > 0.5]
    assert 30.0 < alarm[0] < 30.5
    held = (times > 33.0) & (times < 40.0)
    assert np.linalg.norm(errors, axis=1)[held].max() < 1.5e-3
    assert alarm[-1] < 43.0
    assert reports[-1, 7] == 1.0


def test_an_organ_that_stands_still_is_known_too():
    rng = np.random.default_rng(1)
    p = OrganEstimatorParams()
    dut, c, z = OrganEstimator(p), constants(p), np.zeros(SIZE)
    z[TIME] = -1.0
    for k in range(1200):
        seen = REST + NOISE * rng.standard_normal(3)
        z = follow(c, z, np.array([*seen, 0.0, 0.0, -1.0, k / RATE, 1.0]))
        if z[FRAMES] >= 480 and z[FRAMES] % 60 == 0:
            dut.look(z)
    told = report(z, 20.0)
    assert told[7] == 1.0
    assert np.linalg.norm(told[:3] - REST) < 1e-4
