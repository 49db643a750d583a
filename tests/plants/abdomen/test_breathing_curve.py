"""Recorded breath in the place of a made one."""

import numpy as np
import pytest

from plants.abdomen.breathing_curve import load_curve, read_unitless
from plants.abdomen.organ_motion import OrganMotionParams
from plants.abdomen.wall_motion import WallMotionParams


def belt(path, seconds=30, rate=100.0):
    t = np.arange(int(seconds * rate)) / rate
    signal = 3.1 + 0.4 * np.sin(2.0 * np.pi * 0.25 * t)
    rows = [f"{0.1 * k},{v}" for k, v in enumerate(signal)]
    path.write_text("ECG,RSP\n" + "\n".join(rows))


def test_a_belts_signal_is_scaled(tmp_path):
    belt(tmp_path / "bio.csv")
    curve = read_unitless(tmp_path / "bio.csv", "RSP", 100.0)
    assert np.abs(curve[:, 1]).max() == pytest.approx(1.0)
    assert curve[100, 0] == pytest.approx(1.0)
    assert curve[100, 1] == pytest.approx(1.0, abs=0.01)  # a quarter of a breath
    with pytest.raises(ValueError, match="it has ECG, RSP"):
        read_unitless(tmp_path / "bio.csv", "rsp", 100.0)


def test_the_wall_follows_a_curve_again_and_again(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("t,b\n0,0\n1,1\n3,-1\n4,0\n")
    wall = WallMotionParams(breathing=[0.01, 0.0, 0.0], curve=str(path))
    for time in (0.5, 4.5, 8.5):
        assert wall.displacement(time)[0] == pytest.approx(0.005)


def test_a_step_may_take_its_time():
    wall = WallMotionParams(step=[0.03, 0.0, 0.0], step_time=2.0, step_duration=0.4)
    told = [wall.displacement(time)[0] for time in (1.9, 2.0, 2.2, 2.4, 9.0)]
    np.testing.assert_allclose(told, [0.0, 0.0, 0.015, 0.03, 0.03], atol=1e-9)


def test_organs_breathe_with_the_recorded_curve(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("t,b\n0,0\n1,1\n3,-1\n4,0\n")
    wall = WallMotionParams(breathing=[0.01, 0.0, 0.0], rate=0.25, curve=str(path))
    organ = OrganMotionParams(breathing=[0.0, 0.0, 0.02])
    assert organ.displacement(0.5, wall)[2] == pytest.approx(0.01)
    late = OrganMotionParams(breathing=[0.0, 0.0, 0.02], lag=0.25)  # a second
    assert late.displacement(1.5, wall)[2] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("t,x\n0,0\n1,1\n", "expected CSV t,b"),
        ("t,b\n0,0\n1,2\n", r"in \[-1, 1\]"),
        ("t,b\n1,0\n0,0.5\n", "rise from 0"),
        ("t,b\n0,0\n1,nan\n", "rise from 0"),
    ],
)
def test_bad_curves_are_refused(tmp_path, text, told):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=told):
        load_curve(str(path))
