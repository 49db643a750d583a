"""Surgeon's tool: its motions, its fulcrum, and what it refuses."""

import math

import numpy as np
from pydrake.common.yaml import yaml_load_typed
import pytest

from plants.surgeon.recording import save_recording
from plants.surgeon.surgeon_tool import (
    SurgeonTool,
    SurgeonToolParams,
    tip_motion,
)
from plants.surgeon.tool_motion import (
    Push,
    push_motion,
    recorded_motion,
    tremor_motion,
    waypoint_motion,
)
from systems.common.signal import view
from systems.common.signals import Shaft


def sample(motion, times):
    return np.array([motion(float(t)) for t in times])


def test_minimum_jerk_between_waypoints():
    motion = waypoint_motion([1.0, 3.0], [[0.0, 0.0, -0.1], [0.04, 0.0, -0.1]])
    assert motion(0.0) == (0.0, 0.0, -0.1, 0.0, 0.0, 0.0)
    assert motion(9.0)[0] == 0.04
    x, _, _, v, _, _ = motion(2.0)
    assert x == pytest.approx(0.02)
    # Peak speed of minimum jerk is 15/8 of the mean (Flash and Hogan 1985).
    assert v == pytest.approx(1.875 * 0.04 / 2.0)
    x, _, _, v, _, _ = motion(1.5)
    assert x == pytest.approx(0.04 * (10 / 4**3 - 15 / 4**4 + 6 / 4**5))


def test_velocity_is_the_derivative_of_position(tmp_path):
    times = np.linspace(0.0, 4.0, 121)
    path = np.c_[0.02 * np.sin(times), 0.01 * np.cos(2 * times), -0.1 + 0.01 * times]
    save_recording(tmp_path / "r.csv", times, path)
    motion = tip_motion(
        SurgeonToolParams(
            recording=str(tmp_path / "r.csv"),
            tremor_rms=1e-4,
            pushes=[Push(start=1.0, hold=0.5), Push(start=2.0, direction=[0, 1, 0])],
        )
    )
    t = np.linspace(-0.2, 4.5, 997)
    h = 1e-6
    numeric = (sample(motion, t + h) - sample(motion, t - h))[:, :3] / (2 * h)
    np.testing.assert_allclose(sample(motion, t)[:, 3:], numeric, atol=2e-5)


def test_push_goes_out_waits_and_withdraws():
    push = Push(start=2.0, direction=[0, 3, 0], distance=0.03, speed=0.05, hold=1.0)
    samples = sample(push_motion(push), np.linspace(0.0, 8.0, 8001))
    assert samples[:, 1].max() == pytest.approx(0.03)
    assert np.abs(samples[:, 4]).max() == pytest.approx(0.05, rel=1e-4)
    assert not samples[:, [0, 2]].any()
    out = samples[:, 1] > 0.03 - 1e-12
    assert out.sum() * 1e-3 == pytest.approx(1.0, abs=0.01)
    assert not samples[-1].any()


def test_tremor_has_its_strength_and_band():
    rate = 500.0
    path = sample(tremor_motion(150e-6, 3), np.arange(20_000) / rate)[:, :3]
    assert math.sqrt((path**2).sum(axis=1).mean()) == pytest.approx(150e-6, rel=0.02)
    power = (np.abs(np.fft.rfft(path, axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(len(path), 1 / rate)
    inside = (hertz > 7.9) & (hertz < 12.1)
    assert power[inside].sum() > 0.99 * power.sum()
    other = sample(tremor_motion(150e-6, 4), [0.0, 0.1])
    assert np.abs(other - sample(tremor_motion(150e-6, 3), [0.0, 0.1])).max() > 1e-6


def test_recording_is_met_at_its_samples_and_held_at_its_ends():
    times = np.array([0.0, 1.0, 1.5, 4.0])
    points = np.array([[0, 0, -0.1], [0.01, 0, -0.1], [0.01, 0.02, -0.1], [0, 0, -0.2]])
    motion = recorded_motion(times, points)
    np.testing.assert_allclose(sample(motion, times)[:, :3], points, atol=1e-12)
    assert motion(-5.0)[:3] == (0.0, 0.0, -0.1)
    assert motion(9.0) == (0.0, 0.0, -0.2, 0.0, 0.0, 0.0)
    # No overshoot, not even over the long gap.
    dense = sample(motion, np.linspace(0, 4, 801))
    assert dense[:, 0].max() <= 0.01 + 1e-12
    assert dense[:, 2].max() <= -0.1 + 1e-12


def test_shaft_passes_the_fulcrum():
    params = SurgeonToolParams(
        p_WG=[0.08, 0.02, 0.003],
        times=[0.0, 1.0],
        points=[[0.0, 0.0, -0.1], [0.05, 0.05, -0.15]],
        tremor_rms=2e-4,
    )
    tool = SurgeonTool(params)
    context = tool.CreateDefaultContext()
    motion = tip_motion(params)
    for t in (0.0, 0.37, 0.9, 4.0):
        context.SetTime(t)
        tip, u = view(Shaft, tool.GetOutputPort("shaft").Eval(context))
        np.testing.assert_allclose(tip, motion(t)[:3])
        assert np.linalg.norm(u) == pytest.approx(1.0)
        assert np.linalg.norm(np.cross(tip - params.p_WG, u)) < 1e-12
        assert u[2] < 0.0
        velocity = tool.GetOutputPort("tip_velocity").Eval(context)
        np.testing.assert_allclose(velocity, motion(t)[3:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"p_WG": [0.0, 0.0]}, "p_WG=.*3 numbers"),
        ({"p_WG": [0.0, 0.0, math.nan]}, "p_WG=.*3 numbers"),
        ({"times": [0.0, 1.0]}, "times=.*one for each of the 1 points"),
        ({"times": [], "points": []}, "at least one"),
        ({"times": [1.0, 1.0], "points": [[0, 0, -0.1]] * 2}, "increasing numbers"),
        ({"times": [math.nan]}, "times=.*any number of numbers >= 0"),
        ({"points": [[0.0, 0.0, math.inf]]}, "points=.*any number of x 3 numbers"),
        ({"points": [[0.05, 0.0, 0.01]]}, "at or above its fulcrum"),
        ({"tremor_rms": -1e-4}, "tremor_rms"),
        ({"tremor_rms": 0.1}, "tremor_rms=0.1 m: .*<= 0.002"),
        ({"tremor_seed": -1}, "tremor_seed"),
        ({"pushes": [Push(direction=[0, 0, 0])]}, "direction.*not all 0"),
        ({"pushes": [Push(direction=[0, 1])]}, "direction=.*3 numbers"),
        ({"pushes": [Push(speed=0.0)]}, r"surgeon_tool.pushes\[0\].speed=0.0 m/s"),
        ({"pushes": [Push(), Push(distance=-0.01)]}, r"pushes\[1\].distance=-0.01 m"),
        ({"pushes": [Push(direction=[0, 0, 1], distance=0.2)]}, "at or above"),
        ({"recording": "nowhere.csv"}, "nowhere.csv: cannot be read"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        SurgeonTool(SurgeonToolParams(**changes))


def test_parameters_come_from_yaml():
    text = """
    p_WG: [0.02, 0.11, 0]
    times: [0, 2]
    points: [[0, 0.02, -0.11], [0.02, 0, -0.1]]
    recording: null
    pushes:
    - {start: 3, direction: [0, -1, 0], distance: 0.03}
    """
    params = yaml_load_typed(schema=SurgeonToolParams, data=text)
    assert params.pushes[0].distance == 0.03
    assert tip_motion(params)(2.5)[:3] == (0.02, 0.0, -0.1)


def test_recording_above_the_fulcrum_is_refused(tmp_path):
    path = tmp_path / "high.csv"
    path.write_text("t,x,y,z\n0,0,0,-0.1\n0.5,0,0,0.02\n")
    with pytest.raises(ValueError, match=r"t=0\.500 s .*high\.csv.*above its fulcrum"):
        SurgeonTool(SurgeonToolParams(recording=str(path)))
