"""Optical tracker: noise against a simulated marker body, latency, losses of sight."""

import math

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import AddRandomInputs, LogVectorOutput
import pytest

from plants.surgeon.surgeon_tool import SurgeonTool, SurgeonToolParams
from systems.common.signal import size, vector, view
from systems.common.signals import Shaft, TrackedShaft
from systems.sensing import optical_tracker
from systems.sensing.optical_tracker import (
    TOOLS,
    MarkerBody,
    MarkerNoise,
    OpticalTracker,
    OpticalTrackerParams,
    SightLoss,
    disturb,
)

PERIOD = 1.0 / 60.0


def run(params, seconds, seed=None, tools=TOOLS):
    """Frames read at the planner's instants, and the true shafts, by tool."""
    builder = DiagramBuilder()
    tracker = builder.AddNamedSystem("tracker", OpticalTracker(params, tools))
    logs = {}
    for tool, x in zip(tools, np.linspace(0.05, -0.05, len(tools)), strict=True):
        points = [[x, 0.0, -0.12], [x, 0.04, -0.12]]
        hand = builder.AddNamedSystem(
            tool, SurgeonTool(SurgeonToolParams(times=[0.0, 1.0], points=points))
        )
        builder.Connect(hand.GetOutputPort("shaft"), tracker.GetInputPort(tool))
        for name, port in (
            (tool, tracker.GetOutputPort(f"{tool}_measured")),
            (f"true {tool}", hand.GetOutputPort("shaft")),
        ):
            logs[name] = LogVectorOutput(port, builder, publish_period=PERIOD)
    AddRandomInputs(PERIOD, builder)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    if seed is not None:
        diagram.SetRandomContext(context, RandomGenerator(seed))
    simulator.AdvanceTo(seconds)
    signals = {True: Shaft, False: TrackedShaft}
    return {
        name: view(signals["true" in name], log.FindLog(context).data().T)
        for name, log in logs.items()
    }


@pytest.mark.parametrize(
    ("latency", "frames"), [(0.0, 1), (0.0142, 1), (PERIOD, 1), (0.02, 2), (0.05, 3)]
)
def test_frame_arrives_at_the_first_instant_after_its_latency(latency, frames):
    logs = run(
        OpticalTrackerParams(latency=latency, body=MarkerBody(noise=0.0)), seconds=0.5
    )
    for tool in TOOLS:
        # Logged before the update of an instant: what its readers see.
        seen, true = logs[tool], logs[f"true {tool}"]
        assert not seen.valid[:frames].any()
        assert (seen.time[:frames] < 0.0).all()
        np.testing.assert_allclose(seen.tip[frames:], true.tip[:-frames], atol=1e-12)
        np.testing.assert_allclose(seen.u[frames:], true.u[:-frames], atol=1e-12)
        exposed = PERIOD * np.arange(len(true.tip) - frames)
        np.testing.assert_allclose(seen.time[frames:], exposed, atol=1e-12)
        assert seen.valid[frames:].all()


def test_noise_is_that_of_a_fitted_marker_body():
    body = MarkerBody()
    u = np.array([0.3, -0.2, -math.sqrt(1 - 0.13)])
    tip = np.array([0.02, 0.01, -0.12])
    rng = np.random.default_rng(0)
    shaft = Shaft(vector(tip), vector(u))
    record = optical_tracker.constants(body)[0]
    n = 6000
    noises = rng.standard_normal((n, size(MarkerNoise)))
    ours = [
        disturb(record, shaft, MarkerNoise(vector(row[:3]), vector(row[3:])))
        for row in noises
    ]
    tips, us = (np.array(part) for part in zip(*ours, strict=True))
    # Independently: four markers across the shaft, each found with noise, and the
    # rigid motion fitted to them (Kabsch); the tip goes with the fitted body.
    e = np.cross(u, [1.0, 0.0, 0.0])
    e /= np.linalg.norm(e)
    f = np.cross(u, e)
    arm = body.spread * math.sqrt(2.0)
    markers = np.array([arm * e, arm * f, -arm * e, -arm * f])
    noise = rng.normal(0.0, body.noise / math.sqrt(3.0), (n, 4, 3))
    seen = markers + noise
    mean = seen.mean(axis=1)
    left, _, right = np.linalg.svd(
        np.einsum("nki,kj->nij", seen - mean[:, None], markers)
    )
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    R = left @ right
    fitted_u = R @ u
    fitted_tip = mean + body.lever * fitted_u + (tip - body.lever * u)

    def spread(samples, axis):
        return (samples @ axis).std()

    for axis in (e, f):
        assert spread(tips, axis) == pytest.approx(spread(fitted_tip, axis), rel=0.05)
        assert spread(us, axis) == pytest.approx(spread(fitted_u, axis), rel=0.05)
    assert spread(tips, u) == pytest.approx(spread(fitted_tip, u), rel=0.05)
    np.testing.assert_allclose(tips.mean(axis=0), tip, atol=4e-5)
    np.testing.assert_allclose(np.linalg.norm(us, axis=1), 1.0)
    # Fitzpatrick 1998, across both axes: FLE^2/N (1 + 2/3 d^2/f^2).
    ratio = 1.0 + 2.0 / 3.0 * (body.lever / body.spread) ** 2
    total = math.sqrt(((tips - tip) ** 2).sum(axis=1).mean())
    assert total == pytest.approx(body.noise * math.sqrt(ratio / 4), rel=0.03)


def test_seed_decides_the_noise():
    one, again, other = (
        run(OpticalTrackerParams(), 0.3, seed)["obstacle"] for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(one.tip, again.tip)
    np.testing.assert_array_equal(one.u, again.u)
    assert np.abs(one.tip - other.tip)[2:].max() > 1e-4


def test_any_number_of_tools_is_tracked():
    logs = run(OpticalTrackerParams(), 0.3, 5, "SXO")
    errors = []
    for tool in "SXO":
        seen, true = logs[tool], logs[f"true {tool}"]
        assert seen.valid[2:].all()
        errors.append(seen.tip[2:] - true.tip[1:-1])
        assert 1e-5 < np.abs(errors[-1]).max() < 5e-3
    assert np.abs(np.corrcoef(np.reshape(errors, (3, -1)))[0, 1:]).max() < 0.7


def test_blocked_tool_keeps_its_last_pose_and_is_invalid():
    params = OpticalTrackerParams(losses=[SightLoss(0.2, 0.3, ["obstacle"])])
    logs = run(params, 0.5, seed=1)
    frames = logs["obstacle"]
    blocked = (frames.time >= 0.2 - 1e-9) & (frames.time < 0.3 - 1e-9)
    assert blocked.sum() == 6
    np.testing.assert_array_equal(frames.valid[2:], 1.0 - blocked[2:])
    before = np.flatnonzero(blocked)[0] - 1
    for kept in (frames.tip, frames.u):
        np.testing.assert_array_equal(kept[blocked], np.tile(kept[before], (6, 1)))
    assert np.ptp(frames.time[blocked]) > 0.0
    assert logs["target"].valid[2:].all()


def test_a_loss_that_names_no_tool_hides_all():
    logs = run(OpticalTrackerParams(losses=[SightLoss(0.2, 0.3)]), 0.5, seed=1)
    for tool in TOOLS:
        lost = logs[tool].valid[2:] == 0.0
        assert lost.sum() == 6


def test_shaft_that_is_not_finite_is_not_seen():
    tracker = OpticalTracker()
    context = tracker.CreateDefaultContext()
    tracker.GetInputPort("target").FixValue(context, [math.nan, 0, -0.1, 0, 0, -1])
    tracker.GetInputPort("obstacle").FixValue(context, [0.0, 0, -0.1, 0, 0, -1])
    tracker.GetInputPort("noise").FixValue(context, np.zeros(12))
    update = tracker.EvalUniquePeriodicDiscreteUpdate(context)
    for group, valid in ((1, 0.0), (2, 1.0)):
        assert np.isfinite(update.value(group)).all()
        assert view(TrackedShaft, update.value(group)).valid == valid


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (OpticalTrackerParams(period=0.0), "period"),
        (OpticalTrackerParams(latency=-0.01), "latency"),
        (OpticalTrackerParams(latency=math.nan), "latency"),
        (OpticalTrackerParams(body=MarkerBody(noise=-1e-4)), "noise"),
        (
            OpticalTrackerParams(body=MarkerBody(noise=0.25)),
            r"body\.noise=0.25 m: .*<= 0.01; the default is 0.00025",
        ),
        (OpticalTrackerParams(body=MarkerBody(markers=2)), "markers=2"),
        (OpticalTrackerParams(body=MarkerBody(spread=0.0)), "spread"),
        (OpticalTrackerParams(body=MarkerBody(lever=-0.3)), "lever"),
        (OpticalTrackerParams(losses=[SightLoss(2.0, 1.0)]), r"losses\[0\].end=1.0"),
        (
            OpticalTrackerParams(losses=[SightLoss(1, 2, ["R"])]),
            "'R'.*target, obstacle",
        ),
    ],
)
def test_bad_parameters_are_refused(params, message):
    with pytest.raises(ValueError, match=message):
        OpticalTracker(params)
