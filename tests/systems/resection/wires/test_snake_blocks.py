"""The snake's blocks: inputs fixed, outputs read."""

import math

import numpy as np
import pytest

from plants.snake.actuation import length_range, wire_lengths
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic_wires import ElasticWires, ElasticWiresParams, WireBreak
from plants.snake.inverse_kernels import BEND, LAST_BEND
from plants.snake.kinematics import forward, frames
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.snake import FAR, NEAR, POSITIONS
from plants.snake.weight import weight
from systems.common.compiled import packed
from systems.common.parameter import check
from systems.resection.wires.resection_ik import (
    HOLD,
    ResectionIk,
    ResectionIkParams,
    follow,
    standing,
    time_between,
)
from systems.resection.wires.snake_location import SnakeLocation
from systems.resection.wires.tip_reference import (
    CircleParams,
    PoseParams,
    TipReference,
    TipReferenceParams,
    circle_target,
    reference,
)
from systems.resection.wires.wire_drums import WireDrums, WireDrumsParams
from systems.resection.wires.wire_forward_actuation import WireForwardActuation
from systems.resection.wires.wire_inverse_actuation import (
    WireInverseActuation,
    WireInverseActuationParams,
    wound_lengths,
)
from systems.resection.wires.wire_tension import WireTension, WireTensionParams
from systems.resection.wires.wire_watch import WireWatch, WireWatchParams

SNAKE, DRIVE = SnakeParams(), SnakeDriveParams()
BENDS = [0.01, 0.4, 0.3, -1.2, 0.5, 2.5, 0.7]
POSTURE = posture_of(BENDS)
STRAIGHT = [*wire_lengths(np.zeros(7), SNAKE), 0.0]


def fixed(dut, **inputs):
    context = dut.CreateDefaultContext()
    for name, value in inputs.items():
        dut.GetInputPort(name).FixValue(context, value)
    return context


def out(dut, context, name):
    return dut.GetOutputPort(name).Eval(context)


def tick(dut, context):
    """One discrete update, and one period of time."""
    new = dut.EvalUniquePeriodicDiscreteUpdate(context)
    for i in range(context.num_discrete_state_groups()):
        context.SetDiscreteState(i, np.array(new.get_vector(i).value()))


def plant_state(posture):
    state = np.zeros(2 * POSITIONS)
    state[NEAR], state[FAR] = posture, posture[1:]
    return state


def target_of(x):
    X_WT, X_WI = forward(x, SNAKE), frames(x, SNAKE)[2]
    return [*X_WT[:3, 3], *X_WT[:3, 2], *X_WI[:3, 2]]


def test_resection_ik_approaches_a_far_target_smoothly_and_meets_it():
    params = ResectionIkParams()
    dut = ResectionIk(params)
    context = fixed(dut, target=target_of(POSTURE))
    rows = [np.zeros(7)]
    for _ in range(200):
        rows.append(np.array(out(dut, context, "posture")))
        tick(dut, context)
    steps = np.abs(np.diff(rows, axis=0))
    assert steps[:, 1:].max() <= params.bend_rate * params.period * 1.001
    assert steps[:, 0].max() <= params.travel_rate * params.period * 1.001
    assert steps[0].max() < 0.1 * steps.max()  # it starts gently
    np.testing.assert_allclose(rows[-1], POSTURE, atol=1e-9)


def test_a_slow_goal_is_met_exactly():
    params = ResectionIkParams()
    motion, c = standing(np.zeros(7)), packed(params)[0]
    for k in range(1, 50):
        goal = np.array([0.0, *[0.5 * params.bend_rate * params.period * k] * 6])
        motion = follow(c, motion, goal)
        np.testing.assert_allclose(motion.x, goal, atol=1e-15)
    shift = np.array([params.travel_rate, *[0.0] * 6])
    assert time_between(c, motion.x, motion.x + shift) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("target", "status"),
    [
        ([0.2, 0, 0.03, 0, 0, 1, 0, 0, 1], BEND),
        ([0, 0, 0.03, 0, 0, 1, 1, 0, -0.1], LAST_BEND),
        ([math.nan, 0, 0.03, 0, 0, 1, 0, 0, 1], HOLD),
        ([0, 0, 0.03, 0, 0, 0, 0, 0, 1], HOLD),
    ],
)
def test_resection_ik_holds_still_when_it_cannot(target, status):
    dut = ResectionIk(posture=POSTURE)
    context = fixed(dut, target=target)
    assert out(dut, context, "status") == [status]
    np.testing.assert_allclose(out(dut, context, "posture"), POSTURE, atol=1e-12)


def test_inverse_and_forward_actuation_undo_each_other():
    weightless = WireInverseActuationParams(gravity=[0.0, 0.0, 0.0])
    inverse, forth = WireInverseActuation(weightless), WireForwardActuation()
    drums = out(inverse, fixed(inverse, posture=POSTURE), "drums")
    np.testing.assert_allclose(drums[:9], wire_lengths(POSTURE, SNAKE))
    context = fixed(forth, lengths=drums, rates=np.zeros(10))
    np.testing.assert_allclose(out(forth, context, "posture"), POSTURE, atol=1e-10)
    assert np.abs(out(forth, context, "residual")).max() < 1e-12
    desired = out(forth, context, "desired_state")
    np.testing.assert_allclose(desired, [*POSTURE, *[0.0] * 7], atol=1e-10)


def test_forward_actuation_leads_by_lag_and_period():
    drive = SnakeDriveParams()
    dut = WireForwardActuation(period=0.02)
    later = np.array(POSTURE) + 1e-3 * np.array([1, 0.1, 0.2, 0.1, -0.2, 0, 0.1])
    one = np.array([*wire_lengths(POSTURE, SNAKE), POSTURE[0]])
    two = np.array([*wire_lengths(later, SNAKE), later[0]])
    lead = drive.kd / drive.kp + 0.02
    context = fixed(dut, lengths=one, rates=(two - one) / lead)
    desired = out(dut, context, "desired_state")
    np.testing.assert_allclose(desired[1:7], later[1:], atol=1e-6)


@pytest.mark.parametrize("broken", [math.nan, math.inf, 1.0])
def test_broken_lengths_leave_the_set_point_where_it_was(broken):
    """No numbers, or a length that no posture has."""
    dut = WireForwardActuation()
    drums = np.append(wire_lengths(POSTURE, SNAKE), POSTURE[0])
    context = fixed(dut, lengths=drums, rates=np.zeros(10))
    before = out(dut, context, "desired_state")
    tick(dut, context)
    for wire in (0, 8):
        worse = drums.copy()
        worse[wire] = broken
        dut.GetInputPort("lengths").FixValue(context, worse)
        np.testing.assert_array_equal(out(dut, context, "desired_state"), before)
        tick(dut, context)


def test_a_broken_posture_leaves_the_drums_where_they_were():
    dut = WireInverseActuation(posture=POSTURE)
    context = fixed(dut, posture=np.full(7, math.nan))
    held = wound_lengths(POSTURE, WireInverseActuationParams(), SNAKE, DRIVE)
    np.testing.assert_array_equal(out(dut, context, "drums"), held)
    other = posture_of([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    dut.GetInputPort("posture").FixValue(context, other)
    good = out(dut, context, "drums")
    assert (good != held).any()
    tick(dut, context)
    dut.GetInputPort("posture").FixValue(context, [math.inf] * 7)
    np.testing.assert_array_equal(out(dut, context, "drums"), good)


def test_sag_is_made_up_for():
    """The servos' set-point is beyond the posture by what its weight makes of them."""
    inverse, forth = WireInverseActuation(), WireForwardActuation()
    drums = out(inverse, fixed(inverse, posture=POSTURE), "drums")
    context = fixed(forth, lengths=drums, rates=np.zeros(10))
    lifted = out(forth, context, "posture")
    drive = SnakeDriveParams()
    gains = np.array([drive.travel_kp, *[drive.kp] * 6])
    load = weight(POSTURE, SNAKE, drive)
    np.testing.assert_allclose(gains * (lifted - POSTURE), -load, atol=1e-9)


def test_pretension_is_wound_in():
    dut = WireInverseActuation(
        WireInverseActuationParams(stiffness=2e4, least_tension=3.0)
    )
    drums = out(dut, fixed(dut, posture=POSTURE), "drums")
    tension = (wire_lengths(POSTURE, SNAKE) - drums[:9]) * 2e4
    np.testing.assert_allclose(tension.reshape(3, 3).min(axis=1), 3.0, rtol=1e-9)


def test_drums_reach_a_command_in_one_period():
    dut = WireDrums()
    command = np.array(STRAIGHT) + 1e-4
    context = fixed(dut, command=command, stop=[0.0])
    tick(dut, context)
    np.testing.assert_allclose(out(dut, context, "lengths"), STRAIGHT, atol=1e-15)
    context.SetTime(0.01)
    np.testing.assert_allclose(out(dut, context, "lengths"), command - 0.5e-4)
    context.SetTime(0.02)
    np.testing.assert_allclose(out(dut, context, "lengths"), command)
    assert out(dut, context, "limited") == [0.0]


def test_drums_slow_down_together_and_keep_their_stroke():
    params = WireDrumsParams()
    dut = WireDrums(params)
    command = np.array(STRAIGHT)
    command[0] += 2e-3
    command[5] -= 1e-3
    context = fixed(dut, command=command, stop=[0.0])
    tick(dut, context)
    rates = out(dut, context, "rates")
    assert rates[0] == pytest.approx(params.wire_rate)
    assert rates[5] == pytest.approx(-params.wire_rate / 2)
    assert out(dut, context, "limited") == [1.0]
    command[0] = 1.0
    dut.GetInputPort("command").FixValue(context, command)
    for k in range(1, 200):
        context.SetTime(0.02 * k)
        tick(dut, context)
    longest = length_range(SNAKE)[1][0] + params.margin
    assert out(dut, context, "lengths")[0] == pytest.approx(longest)
    assert out(dut, context, "limited") == [2.0]


@pytest.mark.parametrize(
    ("stop", "change"), [(1.0, 1e-4), (0.0, math.nan)], ids=["stop", "nan"]
)
def test_drums_stand_still(stop, change):
    dut = WireDrums()
    context = fixed(dut, command=np.array(STRAIGHT) + change, stop=[stop])
    tick(dut, context)
    assert (out(dut, context, "rates") == 0.0).all()


def test_location_is_the_kinematics():
    dut = SnakeLocation()
    context = fixed(dut, state=plant_state(POSTURE))
    np.testing.assert_allclose(out(dut, context, "posture"), POSTURE, atol=1e-14)
    np.testing.assert_allclose(out(dut, context, "bends"), BENDS, atol=1e-14)
    X_WT = forward(POSTURE, SNAKE)
    expected = [*X_WT[:3, 3], *X_WT[:3, 2]]
    np.testing.assert_allclose(out(dut, context, "tool"), expected, atol=1e-14)
    state = plant_state(POSTURE)
    state[FAR[2]] += 1e-3
    assert out(dut, fixed(dut, state=state), "coupler_error") == pytest.approx(1e-3)


def test_tension_has_its_minimum():
    dut = WireTension(WireTensionParams(least=2.0))
    actuation = [0.5, 0.01, -0.02, 0.005, 0.0, 0.003, 0.001]
    context = fixed(dut, state=plant_state(POSTURE), net_actuation=actuation)
    T = out(dut, context, "tension").reshape(3, 3)
    np.testing.assert_allclose(T.min(axis=1), 2.0)


def test_elastic_wires_push_both_balls_alike_and_snap():
    params = ElasticWiresParams(breaks=[WireBreak(wire=1, time=2.0)])
    dut = ElasticWires(params)
    lengths = [*(wire_lengths(POSTURE, SNAKE) - 2e-4), 0.01]
    context = fixed(
        dut, state=plant_state(POSTURE), lengths=lengths, rates=np.zeros(10)
    )
    np.testing.assert_allclose(out(dut, context, "tension"), 4.0)
    force = out(dut, context, "generalized_force")
    np.testing.assert_array_equal(force[NEAR[1:]], force[FAR])
    assert force[0] == 0.0
    assert out(dut, context, "travel")[0] == pytest.approx(0.01)
    measured = out(dut, context, "measured")
    np.testing.assert_allclose(measured[:9], wire_lengths(POSTURE, SNAKE), atol=1e-15)
    context.SetTime(2.0)
    assert out(dut, context, "measured")[1] == lengths[1]
    assert out(dut, context, "tension")[1] == 0.0


def test_watch_raises_one_alarm_and_keeps_it():
    dut = WireWatch(WireWatchParams(samples=2))
    context = fixed(dut, tension=[4.0] * 9)
    for time, tension in ((0.0, 4.0), (0.02, 0.1), (0.04, 4.0), (0.06, 0.1)):
        context.SetTime(time)
        dut.GetInputPort("tension").FixValue(context, [4.0] * 6 + [tension] + [4.0] * 2)
        tick(dut, context)
        assert out(dut, context, "stop") == [0.0]  # one slack sample is not enough
    context.SetTime(0.08)
    tick(dut, context)
    dut.GetInputPort("tension").FixValue(context, [4.0] * 9)
    tick(dut, context)
    assert out(dut, context, "stop") == [1.0]
    np.testing.assert_allclose(out(dut, context, "alarm"), [0.08, 3.0])


def test_a_tension_that_is_no_number_counts_as_slack():
    dut = WireWatch(WireWatchParams(samples=1))
    context = fixed(dut, tension=[4.0] * 4 + [math.nan] + [4.0] * 4)
    tick(dut, context)
    assert out(dut, context, "stop") == [1.0]
    np.testing.assert_array_equal(out(dut, context, "alarm"), [0.0, 2.0])


def test_reference_circle():
    circle = CircleParams(p_WC=[0.0, 0.01, 0.04], n_WT=[0.0, 1.0, 1.0])
    n = np.array(circle.n_WT) / math.sqrt(2)
    for time in np.linspace(0.0, 5.0, 40):
        target = circle_target(circle, time)
        offset = np.subtract(target.p, circle.p_WC)
        assert np.linalg.norm(offset) == pytest.approx(circle.radius)
        assert offset @ n == pytest.approx(0.0, abs=1e-15)
        assert math.acos(target.n_I @ n) == pytest.approx(circle.lean)
    one, other = circle_target(circle, 1.0), circle_target(circle, 5.0)
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_reference_poses_take_turns():
    poses = [PoseParams(p_WT=[x, 0.0, 0.04]) for x in (0.0, 0.01)]
    params = TipReferenceParams(poses=poses, dwell=2.0, lead=0.02)
    assert reference(params, 1.99).p[0] == 0.0
    assert reference(params, 2.0).p[0] == 0.01
    assert reference(params, 4.1).p[0] == 0.0
    dut = TipReference(params)
    context = dut.CreateDefaultContext()
    context.SetTime(1.99)
    assert out(dut, context, "target")[0] == 0.01
    assert out(dut, context, "reference")[0] == 0.0


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (
            ResectionIkParams(bend_rate=0.0),
            "resection_ik.bend_rate=0.0 rad/s: expected",
        ),
        (WireDrumsParams(wire_rate=-1.0), "wire_drums.wire_rate=-1.0"),
        (
            WireInverseActuationParams(stiffness=-1.0),
            "stiffness=-1.0 N/m: expected",
        ),
        (WireTensionParams(least=-1.0), "wire_tension.least=-1.0 N: expected >= 0"),
        (WireWatchParams(samples=0), "wire_watch.samples=0: expected >= 1"),
        (WireWatchParams(period=0.0), "wire_watch.period=0.0 s: expected >= 0.001"),
        (
            ElasticWiresParams(breaks=[WireBreak(9)]),
            r"elastic_wires.breaks\[0\].wire=9: expected >= 0 and <= 8",
        ),
        (
            ElasticWiresParams(breaks=[WireBreak(1, -1.0)]),
            r"breaks\[0\].time=-1.0 s: expected >= 0",
        ),
        (TipReferenceParams(dwell=0.0), "tip_reference.dwell=0.0 s: expected >= 0.1"),
        (TipReferenceParams(lead=-1.0), "tip_reference.lead=-1.0 s"),
        (
            TipReferenceParams(poses=[PoseParams(n_WT=[0.0, 0.0, 0.0])]),
            r"poses\[0\].n_WT=.*expected a direction",
        ),
        (
            TipReferenceParams(poses=[PoseParams(p_WT=[0.0])]),
            r"poses\[0\].p_WT=.*expected 3 numbers",
        ),
    ],
)
def test_bad_parameters_are_refused(params, message):
    with pytest.raises(ValueError, match=message):
        check(params)
