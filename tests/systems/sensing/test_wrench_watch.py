"""Tests of the wrench watch against readings made from a wall's own law."""

import numpy as np
import pytest

from systems.common.signal import flat, vector
from systems.common.signals import ShaftMotion, Wrench
from systems.sensing.wrench_kernel import SILENCE
from systems.sensing.wrench_watch import WrenchWatch, WrenchWatchParams

SAMPLE = 1 / 120
DEPTH = 0.25
NOISE = WrenchWatchParams().force_noise


def readings(seed, n, stiffness, place, wall=lambda k: 0.0, noise=NOISE):
    """Shafts that point down, moved sideways as `place(k)`, and the wall's wrenches."""
    rng = np.random.default_rng(seed)
    u = np.array([0.0, 0.0, -1.0])
    for k in range(n):
        p = np.array([place(k), 0.0, DEPTH])
        true = stiffness * np.array([wall(k) - place(k), 0.0, 0.0])
        f = true + noise * rng.standard_normal(3)
        m = DEPTH * np.cross(u, true) + 0.1 * noise * rng.standard_normal(3)
        shaft = ShaftMotion(vector(p), vector(u), (0.0,) * 3, (0.0,) * 3)
        yield shaft, Wrench(vector(f), vector(m), 1.0)


def watched(stream):
    """What the block says of readings, one after the other."""
    dut = WrenchWatch()
    context = dut.CreateDefaultContext()
    rows = []
    for shaft, wrench in stream:
        dut.GetInputPort("shaft").FixValue(context, flat(shaft))
        dut.GetInputPort("wrench").FixValue(context, flat(wrench))
        rows.append(np.array(dut.GetOutputPort("believed").Eval(context)))
        new = dut.EvalUniquePeriodicDiscreteUpdate(context).value()
        context.SetDiscreteState(np.array(new))
    return np.array(rows)


def valid(stream):
    return watched(stream)[:, Wrench._fields.index("valid") - len(Wrench._fields)]


def relaxing(k):
    """A shaft that goes 10 mm to the wall's new place at 0.1 m/s."""
    return min(0.1 * k * SAMPLE, 0.01)


@pytest.mark.parametrize("stiffness", [150.0, 500.0, 3000.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_sound_sensor_is_believed(stiffness, seed):
    def breath(k):
        return 0.005 * np.sin(0.4 * np.pi * k * SAMPLE)

    still = readings(seed, 600, stiffness, lambda k: 0.0, breath)
    assert valid(still).all()
    assert valid(readings(seed, 60, stiffness, relaxing, lambda k: 0.01)).all()


def test_a_jump_of_the_wall_is_believed():
    def jump(k):
        return 0.03 if k > 10 else 0.0

    def after(k):
        return min(max(0.25 * (k - 12) * SAMPLE, 0.0), 0.03)

    assert valid(readings(0, 60, 500.0, after, jump)).all()


@pytest.mark.parametrize("stiffness", [150.0, 500.0, 3000.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_wrong_sign_is_never_believed_again(stiffness, seed):
    """The shaft runs away along what it is told, ever faster."""

    def away(k):
        return 2e-4 * np.exp(k / 12)

    def flipped():
        for shaft, w in readings(seed, 90, stiffness, away):
            yield shaft, Wrench(vector(-np.array(w.f)), vector(-np.array(w.m)), 1.0)

    believed = valid(flipped())
    first = int(np.flatnonzero(believed == 0.0)[0])
    assert stiffness * away(first) < 6.0  # N, when it is noticed
    assert not believed[first:].any()


def test_a_fast_wall_is_told_from_a_wrong_sign_once_the_arm_gave_way():
    """30 mm in 0.2 s, a third of which the shaft follows; then it is limp."""

    def wall(k):
        return 0.03 * min(k / 24, 1.0) ** 2

    def limp(k):
        followed = 0.3 * wall(k)
        return 0.03 - (0.03 - followed) * np.exp(-max(k - 24, 0) / 70)

    def shaft(k):
        return 0.3 * wall(k) if k < 24 else limp(k)

    stream = list(readings(3, 120, 500.0, shaft, wall))
    believed = valid(stream)
    assert not believed[20:24].any() and believed[48:].all()
    for k, (pose, w) in enumerate(stream[20:], 20):
        flipped = Wrench(vector(-np.array(w.f)), vector(-np.array(w.m)), 1.0)
        stream[k] = pose, flipped
    assert not valid(stream)[48:].any()


def test_a_frozen_reading_is_noticed_within_a_fifth_of_a_second():
    stream = list(readings(1, 120, 500.0, lambda k: 1e-3))
    frozen = stream[60][1]
    believed = valid([*stream[:60], *((shaft, frozen) for shaft, _ in stream[60:])])
    assert believed[:60].all()
    assert not believed[60 + 24 :].any()


@pytest.mark.parametrize("size", [3.0, 6.0, 20.0, 1e9, np.nan])
def test_a_force_without_its_moment_is_silence(size):
    stream = list(readings(2, 30, 500.0, lambda k: 1e-3))
    shaft, w = stream[20]
    stream[20] = shaft, w._replace(f=(w.f[0] + size, w.f[1], w.f[2]))
    rows = watched(stream)
    np.testing.assert_array_equal(rows[20], flat(SILENCE))
    assert rows[21:].any(axis=1).all()  # and heard again


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match="still_time"):
        WrenchWatch(WrenchWatchParams(still_time=0.0))
