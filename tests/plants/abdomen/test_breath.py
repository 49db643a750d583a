"""The breath's clock and what disturbs it, and the organ that moves with it."""

import numpy as np
import pytest

from plants.abdomen.breath import COUGH, Irregular
from plants.abdomen.organ_motion import OrganMotionParams, organ_trajectory
from plants.abdomen.wall_motion import WallMotionParams

TIMES = np.arange(0.0, 60.0, 1 / 240)


def velocities(irregular: Irregular, wave: str = "sine") -> np.ndarray:
    wall = WallMotionParams(
        breathing=[0.0, 0.0, 0.008], rate=0.25, wave=wave, irregular=irregular
    )
    z = np.array([wall.displacement(t)[2] for t in TIMES])
    return np.diff(z) * 240


def test_without_disturbance_the_clock_is_the_time():
    assert Irregular().breath(12.3, 0.25) == (0.25 * 12.3, 1.0)


@pytest.mark.parametrize("wave", ["sine", "ventilator"])
def test_jitter_changes_lengths_and_not_continuity(wave):
    regular = np.abs(velocities(Irregular(), wave)).max()
    irregular = Irregular(jitter=0.05, seed=3)
    assert np.abs(velocities(irregular, wave)).max() < 1.3 * regular
    turns = [irregular.breath(t, 0.25)[0] for t in TIMES]
    starts = np.interp(np.arange(1, 14), turns, TIMES)
    assert 0.02 < np.diff(starts).std() / 4.0 < 0.12
    assert Irregular(jitter=0.05, seed=4).breath(30.0, 0.25) != irregular.breath(
        30.0, 0.25
    )


def test_a_breath_is_held_and_goes_on():
    v = np.abs(velocities(Irregular(holds=[20.0, 25.0])))
    held = (TIMES[1:] > 21.0) & (TIMES[1:] < 25.0)
    assert v[held].max() < 1e-4
    assert v[TIMES[1:] > 27.0].max() > 0.01
    irregular = Irregular(holds=[20.0, 25.0])
    assert irregular.clock(40.0) == pytest.approx(35.0, abs=1e-3)


def test_a_rate_changes():
    irregular = Irregular(quicker=0.2, quicker_time=10.0, quicker_duration=10.0)
    assert irregular.clock(10.0) == 10.0
    assert irregular.clock(41.0) - irregular.clock(40.0) == pytest.approx(1.2)


def test_an_organ_is_thrown_and_lags():
    wall = WallMotionParams(rate=0.25, irregular=Irregular(coughs=[5.0]))
    organ = OrganMotionParams(breathing=[0.005, 0.0, 0.0], lag=0.5, cough=[0, 0, 0.01])
    assert organ.displacement(5.0 + COUGH / 2, wall)[2] == pytest.approx(0.01)
    assert organ.displacement(1.0, wall)[0] == pytest.approx(-0.005)
    motion = organ_trajectory(organ, wall, [0.0, 0.0, -0.12], 10.0)
    np.testing.assert_allclose(
        motion.value(1.0).ravel(), [-0.005, 0.0, -0.12], atol=1e-9
    )


def test_a_recorded_motion_goes_on_for_ever(tmp_path):
    file = tmp_path / "organ.csv"
    file.write_text("t,x,y,z\n0,0.0,0,0\n1,0.002,0,0\n2,0.004,0,0\n4,0.002,0,0\n")
    organ = OrganMotionParams(recording=str(file))
    wall = WallMotionParams()
    x = [organ.displacement(t, wall)[0] for t in (1.0, 5.0, 3.0)]
    assert x[0] == pytest.approx(x[1])
    assert x[2] - x[0] == pytest.approx(0.001)


@pytest.mark.parametrize("holds", [[3.0], [5.0, 4.0]])
def test_bad_input(holds):
    from systems.common.parameter import check

    with pytest.raises(ValueError, match="rising times in pairs"):
        check(Irregular(holds=holds))
