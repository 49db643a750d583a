"""Trajectory estimator: accuracy, honesty, lost sight, and what it refuses."""

import math
from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput
import pytest
from scipy.linalg import expm

from plants.surgeon.recording import SWEEP_VIA, synthesize_sweep
from plants.surgeon.surgeon_tool import SurgeonTool, SurgeonToolParams
from plants.surgeon.tool_motion import (
    recorded_motion,
    tremor_motion,
    waypoint_motion,
)
from systems.bypass import obstacle_tools
from systems.bypass.obstacle_tools import Margins
from systems.common.signal import Vector, flat, vector, view
from systems.common.signals import ALIGNED, Estimate, Shaft, TrackedShaft
from systems.sensing import optical_tracker
from systems.sensing.optical_tracker import (
    TOOLS,
    MarkerBody,
    MarkerNoise,
    OpticalTracker,
    OpticalTrackerParams,
    disturb,
)
from systems.sensing.trajectory_estimator import (
    TrajectoryEstimator,
    TrajectoryEstimatorParams,
    absorb,
    constants,
    initial,
    predict,
)

DT = 1.0 / 60.0
BODY = MarkerBody()
MARKERS = optical_tracker.constants(BODY)[0]
G = [0.0, 0.09, 0.0]


def shaft(tip):
    u = np.subtract(tip, G)
    return Shaft(vector(tip), vector(u / np.linalg.norm(u)))


def frame(tip, time, valid=1.0):
    """A frame of a tool with its tip at a place."""
    return TrackedShaft(*shaft(tip), time, valid)


THERE = [0.0, 0.0, -0.12]


class Row(NamedTuple):
    """How far an estimate is off, the true speed, and what the estimate says."""

    e_p: Vector
    e_v: Vector
    speed: float
    sigma_p: float
    sigma_v: float
    sigma_a: float
    known: float
    age: float


def track(motion, seed, params=None, seconds=20.0, hidden=(), tremor=1e-4):
    """Errors, true speed and stated figures at the planner's instants.

    A frame exposed at t is read at t + 1/60, where the estimate is compared with the
    truth of that instant, as in the diagram.
    """
    params = params or TrajectoryEstimatorParams()
    dut = constants(params)[0]
    rng = np.random.default_rng(seed)
    shake = tremor_motion(tremor, seed) if tremor else lambda t: (0.0,) * 6
    x = initial(params)
    rows = []
    for k in range(round(seconds / DT)):
        t = k * DT
        tip = [p + d for p, d in zip(motion(t)[:3], shake(t)[:3], strict=True)]
        noise = MarkerNoise(
            vector(rng.standard_normal(3)), vector(rng.standard_normal(3))
        )
        m = disturb(MARKERS, shaft(tip), noise)
        valid = not any(start <= t < end for start, end in hidden)
        x = absorb(dut, x, TrackedShaft(m.tip, m.u, t, float(valid)))
        estimate = predict(dut, x, t + DT)
        now, d = motion(t + DT), shake(t + DT)
        e_p = np.subtract(estimate.p, now[:3]) - d[:3]
        e_v = np.subtract(estimate.v, now[3:])
        figures = Row(vector(e_p), vector(e_v), math.hypot(*now[3:]), *estimate[4:])
        rows.append(flat(figures))
    return np.array(rows)


def rms(errors):
    return math.sqrt((errors**2).sum(axis=1).mean())


def hand(seed):
    return recorded_motion(
        *synthesize_sweep(seed, SWEEP_VIA, rate=60.0, tremor_rms=0.0)
    )


def test_hand_like_motion_is_followed_and_the_sigmas_are_honest():
    rows = view(Row, np.vstack([track(hand(s), s)[120:] for s in range(4)]))
    e_p, e_v = rms(rows.e_p), rms(rows.e_v)
    # The tracker alone: 0.25/2 sqrt(1 + 2/3 (350/35)^2) = 1.0 mm.
    assert e_p < 0.35e-3
    assert e_v < 7e-3
    assert 0.6 < e_p / math.sqrt(3.0 * (rows.sigma_p**2).mean()) < 1.1
    assert 0.6 < e_v / math.sqrt(3.0 * (rows.sigma_v**2).mean()) < 1.1
    assert rows.known.all()  # never lost


@pytest.mark.parametrize("speed", [0.01, 0.03, 0.06])
def test_obstacle_speeds_are_followed(speed):
    # Across the way and back, peak speed 15/8 of the mean.
    leg = 1.875 * 0.06 / speed
    there, back = [-0.03, 0.0, -0.11], [0.03, 0.0, -0.11]
    motion = waypoint_motion([3.0, 3.0 + leg, 3.0 + 2 * leg], [there, back, there])
    rows = view(Row, track(motion, 1, seconds=3.0 + 2 * leg)[180:])
    assert rows.known.all()
    assert rms(rows.e_p) < 0.4e-3
    assert rms(rows.e_v[rows.speed > 0.5 * speed]) < 6e-3


def test_filter_is_consistent_when_its_model_holds():
    """NEES over position, velocity and acceleration in a Monte Carlo of 80 runs."""
    sigma, tau, s = 0.1, 0.25, BODY.sigma_position()
    # Without a lever the noise is the markers' mean's, the same along all axes, and
    # the fulcrum, which lies behind, has no say.
    params = TrajectoryEstimatorParams(
        body=MarkerBody(lever=0.0),
        sigma_acceleration=sigma,
        acceleration_time=tau,
        tremor_rms=0.0,
        fulcrum=[0.0, 0.0, 0.0],
    )
    dut = constants(params)[0]
    A = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -1 / tau]])
    Phi = expm(A * DT)
    W = np.zeros((3, 3))
    W[2, 2] = 2 * sigma**2 / tau
    block = expm(np.block([[-A, W], [np.zeros((3, 3)), A.T]]) * DT)
    # Scaled, because position's variance in one step is below Cholesky's reach.
    root = np.linalg.cholesky(Phi @ block[:3, 3:] + 1e-20 * np.eye(3))
    rng = np.random.default_rng(11)
    nees = []
    for _ in range(80):
        truth = np.zeros((3, 3))  # rows p, v, a; columns x, y, z
        truth[1] = rng.normal(0.0, params.sigma_velocity, 3)
        truth[2] = rng.normal(0.0, sigma, 3)
        x = initial(params)
        for k in range(90):
            seen = truth[0] + rng.normal(0.0, s, 3)
            m = TrackedShaft(vector(seen), (0.0, 0.0, -1.0), k * DT, 1.0)
            x = absorb(dut, x, m)
            if k < 89:
                truth = Phi @ truth + root @ rng.standard_normal((3, 3))
        assert x.time == 89 * DT
        pp, pv, pa, vv, va, aa = x.P
        P = np.array([[pp, pv, pa], [pv, vv, va], [pa, va, aa]])
        error = np.array([x.p, x.v, x.a]) - truth
        nees.append(np.trace(error.T @ np.linalg.solve(P, error)))
    # chi-square with 9 degrees of freedom: mean 9, 4 standard errors of 80 runs.
    assert np.mean(nees) == pytest.approx(9.0, abs=4 * math.sqrt(18 / 80))


def test_lost_sight_is_ridden_through_then_unknown_then_resumed():
    motion = waypoint_motion([0.0, 6.0], [[-0.04, 0.0, -0.11], [0.04, 0.0, -0.11]])
    rows = view(Row, track(motion, 2, seconds=6.0, hidden=[(3.0, 4.5)]))
    known, sigma, age = rows.known, rows.sigma_p, rows.age
    t = (np.arange(len(known)) + 1) * DT
    error = np.sqrt((rows.e_p**2).sum(axis=1))
    lost = t[(known == 0.0) & (t > 1.0)]
    # It says so within 0.2 to 0.5 s, before the tip is 3 sigma_limit off.
    assert 3.2 < lost[0] < 3.5
    assert lost[-1] < 4.5 + 3 * DT
    assert error[(known == 1.0) & (t > 0.2)].max() < 0.009
    blind = (t > 3.0 + 2 * DT) & (t < 4.5)
    assert (np.diff(sigma[blind]) > 0.0).all()
    np.testing.assert_allclose(np.diff(age[blind]), DT, atol=1e-9)
    assert (error[blind] < 4.0 * sigma[blind] * math.sqrt(3.0)).all()
    assert rms(rows.e_p[t > 5.0]) < 0.4e-3


def test_short_loss_passes_unnoticed():
    motion = waypoint_motion([0.0, 6.0], [[-0.04, 0.0, -0.11], [0.04, 0.0, -0.11]])
    rows = view(Row, track(motion, 3, seconds=5.0, hidden=[(3.0, 3.1)])[30:])
    assert rows.known.all()


@pytest.fixture
def settled():
    params = TrajectoryEstimatorParams(fulcrum=G)
    dut, x = constants(params)[0], initial(params)
    for k in range(60):
        x = absorb(dut, x, frame(THERE, k * DT))
    return dut, x


@pytest.mark.parametrize(
    "measurement",
    [
        frame(THERE, 1.0, 0.0),  # invalid
        frame(THERE, 59 * DT),  # seen before
        frame(THERE, 0.5),  # older
        frame([0.03, 0.0, -0.12], 1.0),  # 30 mm in one frame
        frame(THERE, 1.0)._replace(tip=(math.nan, 0.0, -0.12)),
        frame(THERE, 1.0)._replace(u=(0.0, 0.0, math.nan)),
        frame(THERE, 1.0)._replace(u=(0.0, 0.0, 0.0)),  # no direction
        frame(THERE, math.nan),
        frame(THERE, 1.0, math.nan),
        frame(THERE, math.inf),
    ],
)
def test_bad_measurement_changes_nothing(settled, measurement):
    dut, x = settled
    assert absorb(dut, x, measurement) == x


def test_tool_that_really_jumped_is_found_again(settled):
    dut, x = settled
    for k in range(60, 100):
        x = absorb(dut, x, frame([0.03, 0.0, -0.12], k * DT))
    estimate = predict(dut, x, 100 * DT)
    np.testing.assert_allclose(estimate.p, [0.03, 0.0, -0.12], atol=1e-3)
    assert estimate.known == 1.0


def test_nothing_is_known_before_the_first_frame():
    params = TrajectoryEstimatorParams()
    estimate = predict(constants(params)[0], initial(params), 0.0)
    assert np.isfinite(flat(estimate)).all()
    assert estimate.known == 0.0


def test_what_the_registration_is_unsure_of_widens_the_margin():
    """An error that all tools' frames share is in no frame's noise."""
    dut = TrajectoryEstimator(TrajectoryEstimatorParams(fulcrum=G))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("measurement").FixValue(context, flat(frame(THERE, 0.5)))
    context.SetTime(0.5)
    output = dut.GetOutputPort("estimate")
    sure = view(Estimate, output.Eval(context).copy())
    told = ALIGNED._replace(sigma=1e-3)
    dut.GetInputPort("alignment").FixValue(context, flat(told))
    unsure = view(Estimate, output.Eval(context).copy())
    assert unsure.sigma_p == pytest.approx(math.hypot(sure.sigma_p, 1e-3))
    assert vector(unsure.p) == vector(sure.p) and unsure.known == 1.0
    record = obstacle_tools.constants(Margins())[0]
    wider = obstacle_tools.margin(record, unsure) - obstacle_tools.margin(record, sure)
    assert wider > 1e-3
    dut.GetInputPort("alignment").FixValue(context, flat(told._replace(sigma=0.01)))
    assert view(Estimate, output.Eval(context).copy()).known == 0.0


def test_block_has_the_frame_in_the_estimate_of_the_same_instant():
    dut = TrajectoryEstimator(TrajectoryEstimatorParams(fulcrum=G))
    context = dut.CreateDefaultContext()
    port = dut.GetInputPort("measurement")
    output = dut.GetOutputPort("estimate")
    port.FixValue(context, flat(frame(THERE, 0.5)))

    def shown():
        return view(Estimate, output.Eval(context).copy())

    context.SetTime(0.5)
    before = context.get_discrete_state(0).value().copy()
    estimate = shown()
    np.testing.assert_allclose(estimate.p, THERE, atol=1e-9)
    np.testing.assert_allclose(estimate.fulcrum, G)
    assert estimate.age == 0.0
    # Reading it changed no state; time alone makes it older.
    np.testing.assert_array_equal(context.get_discrete_state(0).value(), before)
    context.SetTime(0.6)
    older = shown()
    assert older.age == pytest.approx(0.1)
    assert older.sigma_p > estimate.sigma_p
    # Storing the state changes nothing in what is put out.
    updated = dut.EvalUniquePeriodicDiscreteUpdate(context).value().copy()
    context.SetDiscreteState(0, updated)
    np.testing.assert_array_equal(flat(shown()), flat(older))


def test_latency_is_made_up_for_in_the_diagram():
    """Tool, tracker and estimator wired up, at the instants of the planner."""
    builder = DiagramBuilder()
    params = SurgeonToolParams(
        p_WG=G, times=[0.0, 4.0], points=[[-0.04, 0.0, -0.11], [0.04, 0.0, -0.11]]
    )
    tool = builder.AddNamedSystem("tool", SurgeonTool(params))
    tracker = builder.AddNamedSystem(
        "tracker",
        OpticalTracker(OpticalTrackerParams(latency=0.03, body=MarkerBody(noise=0.0))),
    )
    zeros = builder.AddNamedSystem("zeros", ConstantVectorSource(np.zeros(12)))
    dut = builder.AddNamedSystem("dut", TrajectoryEstimator())
    for name in TOOLS:
        builder.Connect(tool.GetOutputPort("shaft"), tracker.GetInputPort(name))
    builder.Connect(zeros.get_output_port(), tracker.GetInputPort("noise"))
    builder.Connect(
        tracker.GetOutputPort("obstacle_measured"), dut.GetInputPort("measurement")
    )
    ports = dut.GetOutputPort("estimate"), tool.GetOutputPort("shaft")
    logs = [LogVectorOutput(port, builder, publish_period=DT) for port in ports]
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(4.0)
    rows = (log.FindLog(simulator.get_context()).data().T for log in logs)
    estimate, true = map(view, (Estimate, Shaft), rows)
    # Two periods old, and yet where the tool is now: it has moved 1.2 mm since.
    np.testing.assert_allclose(estimate.age[5:], 2 * DT, atol=1e-9)
    error = np.linalg.norm(estimate.p[60:] - true.tip[60:], axis=1)
    assert error.max() < 0.1e-3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period": 0.0}, "period=0.0"),
        ({"sigma_acceleration": -0.1}, "sigma_acceleration"),
        ({"acceleration_time": math.nan}, "acceleration_time"),
        ({"gate": 0.0}, "gate"),
        ({"sigma_limit": math.inf}, "sigma_limit"),
        ({"age_limit": 0.001}, "at least the period"),
        ({"tremor_rms": -1e-4}, "tremor_rms"),
        ({"wall_height": math.nan}, "wall_height"),
        ({"fulcrum": [0.0, 0.0]}, "fulcrum=.*3 numbers >= -1"),
        ({"fulcrum": [0.0, 0.0, math.nan]}, "fulcrum=.*3 numbers >= -1"),
        ({"body": MarkerBody(lever=math.nan)}, "lever"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        TrajectoryEstimator(TrajectoryEstimatorParams(**changes))
