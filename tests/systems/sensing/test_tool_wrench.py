"""The tool's wrench against the plant's own bushing, and the sensor's faults."""

import functools

import numpy as np
import pytest

from diagrams.common.run import simulate
from diagrams.studies import load_scenario
from diagrams.wrist.diagram import make_wrist_diagram
from plants.instruments.wrist_sensor import Felt, Mount
from systems.common.signal import example, flat, view
from systems.common.signals import Wrench
from systems.sensing import sensor_noise
from systems.sensing.tool_wrench import ToolWrench, ToolWrenchParams

QUIET = [
    "compare=[]",
    *(
        f"tool_wrench.{name}=0.0"
        for name in ("force_noise", "moment_noise", "force_drift", "moment_drift")
    ),
]


@functools.cache
def quiet_run():
    run = simulate(load_scenario("pwe_arc", QUIET, duration=1.5))
    assert not run.error
    return run


def test_a_quiet_sensor_reads_the_walls_force_while_the_arm_moves():
    run = quiet_run()
    f, u = run.wrist.wrench.f, run.wrist.shaft.u
    lateral = f - u * np.sum(f * u, axis=1)[:, None]
    force = run.wall.force.f
    late = run.signals["time"] > 0.1
    assert np.linalg.norm(force[late], axis=1).max() > 0.9  # the probe
    np.testing.assert_allclose(lateral[late], force[late], atol=2e-3)


def test_the_moment_tells_the_contacts_depth():
    run = quiet_run()
    shaft, (f, m, _) = run.wrist.shaft, run.wrist.wrench
    loaded = np.linalg.norm(run.wall.force.f, axis=1) > 0.8
    across = np.cross(shaft.u, f)
    lever = np.sum(across * m, axis=1) / np.sum(across**2, axis=1)
    true = np.sum(shaft.u * (run.wall.fulcrum.p - shaft.p), axis=1)
    off = abs(lever - true)[loaded]
    assert np.median(off) < 5e-5 and off.max() < 1e-3  # at a sudden turn of the probe


def test_noise_is_a_function_of_seed_and_sample():
    faults = ((0.05,) * 3 + (0.005,) * 3, (0.0,) * 6, (0.0,) * 6)
    rows = np.array([sensor_noise.fault(4, i, faults) for i in range(5000)])
    np.testing.assert_allclose(rows.std(axis=0), faults[0], rtol=0.05)
    np.testing.assert_array_equal(rows[3210], sensor_noise.fault(4, 3210, faults))
    assert abs(np.corrcoef(rows[:-1, 0], rows[1:, 0])[0, 1]) < 0.05
    assert not np.array_equal(rows[0], sensor_noise.fault(5, 0, faults))


def test_drift_goes_on_across_blocks():
    faults = ((0.0,) * 6, (1.0,) * 6, (0.0,) * 6)
    rows = np.array([sensor_noise.fault(4, i, faults) for i in range(3000)])
    steps = np.diff(rows, axis=0)
    np.testing.assert_allclose(steps.std(axis=0), 1.0, rtol=0.1)
    assert np.abs(steps).max() < 5.5


def read(dut: ToolWrench, force: float = 0.0, time: float = 0.0):
    context = dut.CreateDefaultContext()
    context.SetTime(time)
    dut.GetInputPort("mount").FixValue(context, flat(example(Mount)))
    felt = example(Felt)._replace(f=(force, 0.0, 0.0))
    dut.GetInputPort("felt").FixValue(context, flat(felt))
    return view(Wrench, np.array(dut.GetOutputPort("wrench").Eval(context)))


def test_taring_takes_the_offset_away():
    kind = dict.fromkeys(("force_noise", "force_drift", "moment_drift"), 0.0)
    tared = read(ToolWrench(ToolWrenchParams(**kind, moment_noise=0.0)))
    left = read(ToolWrench(ToolWrenchParams(**kind, moment_noise=0.0, tare_samples=0)))
    np.testing.assert_allclose(np.abs(tared.f - left.f), 0.3, atol=1e-9)


def test_saturated_silent_and_nan_are_not_valid():
    assert read(ToolWrench()).valid == 1.0
    assert not flat(read(ToolWrench(), 100.0)).any()
    assert not flat(read(ToolWrench(), float("nan"))).any()
    dut = ToolWrench(ToolWrenchParams(lost=[1.0, 2.0]))
    assert [read(dut, time=t).valid for t in (0.5, 1.5, 2.5)] == [1.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"force_noise": -0.1}, "tool_wrench.force_noise=-0.1 N: expected >= 0"),
        ({"force_range": 1e9}, "force_range=1000000000.0 N: expected > 0 and <= 500"),
        ({"lost": [1.0]}, "rising times in pairs"),
        ({"delay": -1}, "delay=-1"),
        ({"mass_error": 3.0}, "mass_error=3.0"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ValueError, match=message):
        ToolWrench(ToolWrenchParams(**change))


@pytest.mark.parametrize(
    ("frame", "message"),
    [("nozzle", "nozzle.*does not exist.*instrument"), ("link7", "weld joint")],
)
def test_a_sensor_frame_that_cannot_be(frame, message):
    scenario = load_scenario("pwe_arc", [f"tool_wrench.frame={frame}"])
    with pytest.raises(ValueError, match=message):
        make_wrist_diagram(scenario)
