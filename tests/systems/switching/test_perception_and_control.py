"""Perception, the control law, and the sum of potentials."""

from math import hypot, inf, nan, pi

import numpy as np
import pytest

from plants.crowd.signals import CAPACITY, Obstacle
from plants.turtlebot.signals import RobotState
from systems.common.compiled import packed
from systems.common.signal import example, flat
from systems.switching.classical_planner import (
    ClassicalParams,
    ClassicalPlanner,
    field_sum,
    summed_fields,
)
from systems.switching.heading_law import UnicycleControlParams, constants
from systems.switching.heading_law import heading_law as compiled_law
from systems.switching.orca_planner import (
    OrcaParams,
    OrcaPlanner,
    orca_step,
    retreats,
)
from systems.switching.perception import Perception, PerceptionParams, perceive
from systems.switching.signals import NOISE, SEEN, Mode, Noise, PlanarVelocity, Seen
from systems.switching.statechart_planner import StatechartPlanner
from systems.switching.switching_planner import SwitchingPlanner
from systems.switching.unicycle_control import UnicycleControl
from tests.loosely import loosely

ROWS = len(SEEN.names)
ROBOT = RobotState(0.0, 0.0, 0.0, 0.0, 0.0)
QUIET = Noise(0.0, 0.0, 0.0, 0.0)

law = loosely(compiled_law, constants)


def heading_law(params, theta, vx, vy, retreat=False):
    """Without a retreat if nothing is said."""
    return law(params, theta, vx, vy, retreat)


def seen_of(params, obstacles, noise):
    """What is seen, as tuples."""
    (table,) = perceive(packed(params)[0], ROBOT, np.array(obstacles), np.array(noise))
    return [Seen(*row) for row in table.tolist()]


def test_perception_sees_within_its_disc_and_adds_noise():
    params = PerceptionParams(3.0, 0.02, 0.05)
    obstacles = [
        Obstacle(2.0, 0.0, 0.3, 0.1, 0.0),
        Obstacle(3.1, 0.0, 0.3, 0.0, 0.0),
        Obstacle(1.0, 1.0, 0.0, 0.0, 0.0),
    ]
    noise = [Noise(1.0, -1.0, 2.0, 0.0), QUIET, QUIET]
    near, far, nothing, *_ = seen_of(params, obstacles, noise)
    assert near == pytest.approx(Seen(0.0, 2.02, -0.02, 0.3, 0.2, 0.0))
    assert far.track == -1.0 and nothing.track == -1.0
    # What is not known in numbers is not overlooked.
    lost, *_ = seen_of(params, [Obstacle(nan, 0.0, 0.3, 0.0, 0.0)], [QUIET])
    assert lost.track == 0.0 and np.isnan(lost.x)


def test_perception_as_a_block():
    dut = Perception(PerceptionParams(vision=1.0))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("robot").FixValue(context, flat(ROBOT))
    rows = np.zeros((CAPACITY, 5))
    rows[3], rows[7] = (0.5, 0.0, 0.3, 0.0, 0.1), (9.0, 0.0, 0.3, 0.0, 0.0)
    dut.GetInputPort("obstacles").FixValue(context, rows.ravel())
    dut.GetInputPort("noise").FixValue(context, flat(example(NOISE)))
    seen = dut.GetOutputPort("seen").Eval(context).reshape(-1, 6)
    assert seen[3].tolist() == [3.0, 0.5, 0.0, 0.3, 0.0, 0.1]
    assert (np.delete(seen, 3, 0)[:, 0] == -1.0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vision": 0.0}, r"perception.vision=0.0 m: expected > 0"),
        ({"vision": 1e9}, r"perception.vision=1000000000.0 m: expected .* <= 100"),
        ({"position_noise": -0.1}, r"position_noise=-0.1 m: expected >= 0"),
        ({"velocity_noise": inf}, r"velocity_noise=inf m/s: expected >= 0"),
    ],
)
def test_bad_perception_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Perception(PerceptionParams(**change))


def test_heading_law():
    params = UnicycleControlParams()
    assert heading_law(params, 0.3, 0.0, 0.0) == (0.0, 0.0)
    assert heading_law(params, 0.0, 0.5, 0.0) == (0.5, 0.0)
    speed, turn = heading_law(params, 0.0, 0.0, 0.5)
    assert speed == pytest.approx(0.0, abs=1e-12) and turn == params.turn_rate
    speed, turn = heading_law(params, 0.0, -0.5, 0.05)
    assert speed == 0.0 and turn > 0.0  # turns round on the spot
    speed, turn = heading_law(params, 0.0, -0.5, 0.05, retreat=True)
    assert speed < -0.45 and turn < 0.0  # backs away, tail first
    # From every heading the turn can be braked in time.
    for error in np.linspace(0.01, pi - 0.01, 40):
        _, turn = heading_law(params, 0.0, np.cos(error), np.sin(error))
        assert turn**2 / (2.0 * params.turn_acceleration) <= error + 1e-9


@pytest.mark.parametrize(("retreat", "sign"), [(0.0, 0.0), (1.0, -1.0)])
def test_the_mode_lets_the_robot_back_away(retreat, sign):
    dut = UnicycleControl()
    context = dut.CreateDefaultContext()
    dut.GetInputPort("robot").FixValue(context, flat(ROBOT))
    dut.GetInputPort("v_R").FixValue(context, flat(PlanarVelocity(-0.5, 0.0)))
    dut.GetInputPort("mode").FixValue(context, flat(Mode(retreat=retreat)))
    speed, _ = dut.GetOutputPort("command").Eval(context)
    assert np.sign(speed) == sign


def test_bad_control_is_refused():
    with pytest.raises(ValueError, match=r"unicycle_control.gain=1e\+?30"):
        UnicycleControl(UnicycleControlParams(gain=1e30))
    with pytest.raises(ValueError, match=r"backwards=0.5 rad: expected >= 1.5708"):
        UnicycleControl(UnicycleControlParams(backwards=0.5))


@pytest.mark.parametrize("broken", [nan, inf, -inf])
@pytest.mark.parametrize("name", ["robot", "seen", "goal"])
@pytest.mark.parametrize(
    "planner", [ClassicalPlanner, OrcaPlanner, StatechartPlanner, SwitchingPlanner]
)
def test_a_broken_input_stops_the_robot(planner, name, broken):
    dut = planner()
    context = dut.CreateDefaultContext()
    inputs = {"robot": ROBOT, "goal": (8.0, 0.0), "seen": [(-1.0, *[0.0] * 5)] * ROWS}
    for port, value in inputs.items():
        dut.GetInputPort(port).FixValue(context, np.ravel(value))

    def step():
        events = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(events)
        return dut.GetOutputPort("v_R").Eval(context)

    assert step()[0] > 0.1
    value = np.ravel(inputs[name]).astype(float)
    value[-1] = broken
    dut.GetInputPort(name).FixValue(context, value)
    assert step().tolist() == [0.0, 0.0]
    dut.GetInputPort(name).FixValue(context, np.ravel(inputs[name]))
    assert step()[0] > 0.1


def test_orca_takes_half_of_an_evasion_and_retreats_in_time():
    """Head on, both as fast: it leaves its line, and may drive backwards."""
    params, place, goal = OrcaParams(), (0.0, 0.0), (8.0, 0.0)
    alone = orca_step(params, place, (0.5, 0.0), goal, [], 0.05)
    assert alone == pytest.approx((0.5, 0.0))
    come = [Seen(0.0, 2.0, 0.05, 0.3, -0.5, 0.0)]
    vx, vy = orca_step(params, place, (0.5, 0.0), goal, come, 0.05)
    assert hypot(vx, vy) <= 0.5 + 1e-9 and vy < -0.03
    # What comes at 0.5 m/s is within 0.3 + 0.38 m in 1.6 s; in 2.6 s.
    assert retreats(place, [come[0]._replace(x=1.5)], 0.38)
    assert not retreats(place, come, 0.38)


def test_what_is_not_seen_does_not_matter():
    assert SEEN.signal(*[0.0] * 6) == Seen(*[0.0] * 6)
    dut = ClassicalPlanner()
    context = dut.CreateDefaultContext()
    dut.GetInputPort("robot").FixValue(context, flat(ROBOT))
    dut.GetInputPort("goal").FixValue(context, [8.0, 0.0])
    seen = np.tile([-1.0, 0.6, 0.1, 0.3, 0.0, 0.0], ROWS)
    dut.GetInputPort("seen").FixValue(context, seen)
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))
    assert dut.GetOutputPort("v_R").Eval(context).tolist() == [0.5, 0.0]


PAIR = [Seen(0.0, 4.1, 5.0, 0.6, 0.0, 0.0), Seen(1.0, 5.9, 5.0, 0.6, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("params", "zero"),
    [
        (ClassicalParams(clipped=False, repulsion=0.1), 4.572),
        (ClassicalParams(clipped=False, repulsion=0.2), 4.452),
        (ClassicalParams(clipped=False, repulsion=0.01), None),
        (ClassicalParams(clipped=False, form="printed"), None),
        (ClassicalParams(form="printed"), None),
        (ClassicalParams(repulsion=0.01), 4.557),
    ],
)
def test_where_the_sum_vanishes_before_a_gap(params, zero):
    """Half-way is y = 5: the gap itself, where the thesis has its Figure 8."""
    line = np.linspace(3.0, 5.0, 2001)
    sums = [field_sum(params, (5.0, y), (5.0, 10.0), PAIR)[1] for y in line]
    turns = np.flatnonzero(np.array(sums) < 0.0)
    assert sums[0] > 0.4
    if zero is None:
        assert not len(turns)
    else:
        assert line[turns[0]] == pytest.approx(zero, abs=2e-3)


def test_equation_2_as_printed_leads_nowhere():
    params = ClassicalParams(attraction="printed", clipped=False)
    v = summed_fields(params, (5.0, 0.0), (5.0, 10.0), [])
    assert v[0] == pytest.approx(v[1]) and hypot(*v) == pytest.approx(0.5)
    for bad in ({"attraction": "sum"}, {"form": "sum"}):
        (name,) = bad
        with pytest.raises(ValueError, match=rf"{name}='sum': expected one of"):
            ClassicalPlanner(ClassicalParams(**bad))


def test_both_forms_push_away_and_keep_the_speed():
    seen = [Seen(0.0, 1.2, 0.0, 0.3, 0.0, 0.0)]
    khatib = summed_fields(ClassicalParams(), (0.5, 0.0), (0.5, 9.0), seen)
    printed = summed_fields(
        ClassicalParams(form="printed"), (0.5, 0.0), (0.5, 9.0), seen
    )
    assert khatib[0] < 0.0 and printed[0] < 0.0
    assert hypot(*khatib) <= 0.5 + 1e-9 and hypot(*printed) <= 0.5 + 1e-9
