"""Optical tracker: noise against a simulated marker body, latency, losses of sight."""

import math

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import AddRandomInputs, LogVectorOutput
import pytest

from plants.surgeon.surgeon_tool import SurgeonTool, SurgeonToolParams
from systems.sensing.optical_tracker import (
    MarkerBody,
    OpticalTracker,
    OpticalTrackerParams,
    SightLoss,
    disturb,
)

PERIOD = 1.0 / 60.0


def run(params, seconds, seed=None):
    """Frames read at the planner's instants, and the true shafts, by tool."""
    builder = DiagramBuilder()
    tracker = builder.AddNamedSystem("tracker", OpticalTracker(params))
    logs = {}
    for tool, x in (("S", 0.05), ("O", -0.05)):
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
    return {name: log.FindLog(context).data().T for name, log in logs.items()}


@pytest.mark.parametrize(
    ("latency", "frames"), [(0.0, 1), (0.0142, 1), (PERIOD, 1), (0.02, 2), (0.05, 3)]
)
def test_frame_arrives_at_the_first_instant_after_its_latency(latency, frames):
    logs = run(
        OpticalTrackerParams(latency=latency, body=MarkerBody(noise=0.0)), seconds=0.5
    )
    for tool in "SO":
        # Logged before the update of an instant: what its readers see.
        seen, true = logs[tool], logs[f"true {tool}"]
        assert not seen[:frames, 7].any()
        assert (seen[:frames, 6] < 0.0).all()
        np.testing.assert_allclose(seen[frames:, :6], true[:-frames], atol=1e-12)
        exposed = PERIOD * np.arange(len(true) - frames)
        np.testing.assert_allclose(seen[frames:, 6], exposed, atol=1e-12)
        assert seen[frames:, 7].all()


def test_noise_is_that_of_a_fitted_marker_body():
    body = MarkerBody()
    u = np.array([0.3, -0.2, -math.sqrt(1 - 0.13)])
    tip = np.array([0.02, 0.01, -0.12])
    rng = np.random.default_rng(0)
    shaft = np.concatenate([tip, u])
    n = 6000
    ours = np.array(
        [
            disturb(
                shaft,
                rng.standard_normal(6),
                body.lever,
                body.sigma_position(),
                body.sigma_direction(),
            )
            for _ in range(n)
        ]
    )
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
        assert spread(ours[:, :3], axis) == pytest.approx(
            spread(fitted_tip, axis), rel=0.05
        )
        assert spread(ours[:, 3:], axis) == pytest.approx(
            spread(fitted_u, axis), rel=0.05
        )
    assert spread(ours[:, :3], u) == pytest.approx(spread(fitted_tip, u), rel=0.05)
    np.testing.assert_allclose(ours[:, :3].mean(axis=0), tip, atol=4e-5)
    np.testing.assert_allclose(np.linalg.norm(ours[:, 3:], axis=1), 1.0)
    # Fitzpatrick 1998, across both axes: FLE^2/N (1 + 2/3 d^2/f^2).
    ratio = 1.0 + 2.0 / 3.0 * (body.lever / body.spread) ** 2
    total = math.sqrt(((ours[:, :3] - tip) ** 2).sum(axis=1).mean())
    assert total == pytest.approx(body.noise * math.sqrt(ratio / 4), rel=0.03)


def test_seed_decides_the_noise():
    one, again, other = (
        run(OpticalTrackerParams(), 0.3, seed)["O"] for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other)[2:, :3].max() > 1e-4


def test_blocked_tool_keeps_its_last_pose_and_is_invalid():
    params = OpticalTrackerParams(losses=[SightLoss(0.2, 0.3, ["O"])])
    logs = run(params, 0.5, seed=1)
    frames = logs["O"]
    blocked = (frames[:, 6] >= 0.2 - 1e-9) & (frames[:, 6] < 0.3 - 1e-9)
    assert blocked.sum() == 6
    np.testing.assert_array_equal(frames[2:, 7], 1.0 - blocked[2:])
    before = frames[np.flatnonzero(blocked)[0] - 1]
    np.testing.assert_array_equal(frames[blocked, :6], np.tile(before[:6], (6, 1)))
    assert np.ptp(frames[blocked, 6]) > 0.0
    assert logs["S"][2:, 7].all()


def test_shaft_that_is_not_finite_is_not_seen():
    tracker = OpticalTracker()
    context = tracker.CreateDefaultContext()
    tracker.GetInputPort("S").FixValue(context, [math.nan, 0, -0.1, 0, 0, -1])
    tracker.GetInputPort("O").FixValue(context, [0.0, 0, -0.1, 0, 0, -1])
    tracker.GetInputPort("noise").FixValue(context, np.zeros(12))
    state = tracker.EvalUniquePeriodicDiscreteUpdate(context).value()
    assert np.isfinite(state).all()
    assert state[7] == 0.0
    assert state[15] == 1.0


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (OpticalTrackerParams(period=0.0), "period"),
        (OpticalTrackerParams(latency=-0.01), "latency"),
        (OpticalTrackerParams(latency=math.nan), "latency"),
        (OpticalTrackerParams(body=MarkerBody(noise=-1e-4)), "noise"),
        (OpticalTrackerParams(body=MarkerBody(noise=0.25)), "noise.*0.25e-3"),
        (OpticalTrackerParams(body=MarkerBody(markers=2)), "markers=2"),
        (OpticalTrackerParams(body=MarkerBody(spread=0.0)), "spread"),
        (OpticalTrackerParams(body=MarkerBody(lever=-0.3)), "lever"),
        (OpticalTrackerParams(losses=[SightLoss(2.0, 1.0)]), "end=1.0"),
        (OpticalTrackerParams(losses=[SightLoss(1, 2, ["R"])]), "'R'.*S or O"),
    ],
)
def test_bad_parameters_are_refused(params, message):
    with pytest.raises(ValueError, match=message):
        OpticalTracker(params)
