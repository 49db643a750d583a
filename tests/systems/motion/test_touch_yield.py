"""Tests of giving way: the tip goes with the push, the task waits and says why."""

import numpy as np
import pytest

from systems.common.signal import example, flat, view
from systems.common.signals import Guide, Permission, RobotTool, Velocity
from systems.common.stops import Stop
from systems.motion.touch_yield import TouchYield, TouchYieldParams
from systems.sensing.touch_watch import Touched

PARAMS = TouchYieldParams(active=True)
TOOL = RobotTool((0.0, 0.0, 0.0), (0.0, 0.0, -0.1))
ONWARDS = (0.02, 0.0, -0.01)


def steps(touches, v_safe=ONWARDS, s=0.5):
    """Velocities of the tip [m/s] and codes after each of these touches."""
    dut = TouchYield(PARAMS)
    context = dut.CreateDefaultContext()
    for name, value in (
        ("v_safe", Velocity(v_safe)),
        ("guide", example(Guide)._replace(s=s)),
        ("robot_tool", TOOL),
    ):
        dut.GetInputPort(name).FixValue(context, flat(value))
    rows = []
    for touch in touches:
        dut.GetInputPort("touch").FixValue(context, flat(touch))
        v = view(Velocity, dut.GetOutputPort("v_R").Eval(context)).v / s
        code = view(Permission, dut.GetOutputPort("permission").Eval(context)).code
        rows.append((v.copy(), float(code)))
        update = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(update)
    return rows


def test_untouched_the_task_goes_on():
    (v, code), *_ = steps([Touched((0.0, 0.0, 0.0), 1.0, 0.0)])
    np.testing.assert_allclose(v, np.divide(ONWARDS, 0.5))
    assert code == 0.0


def test_the_pushed_place_goes_with_the_force_less_what_is_borne():
    *_, (v, code) = steps([Touched((0.0, 1.1, 0.0), 0.5, 1.0)] * 60)
    np.testing.assert_allclose(v, [0.0, PARAMS.admittance * 1.0 / 0.5, 0.0], atol=1e-9)
    assert code == Stop.TOUCHED


def test_it_starts_gently_and_has_a_limit():
    hard = [Touched((0.0, 50.0, 0.0), 0.5, 1.0)] * 60
    speeds = [float(np.linalg.norm(v)) for v, _ in steps(hard)]
    assert np.diff(speeds).max() <= PARAMS.acceleration * PARAMS.period + 1e-12
    assert speeds[-1] == pytest.approx(PARAMS.speed)


def test_it_stands_where_it_has_given_way_enough():
    dut = TouchYield(TouchYieldParams(active=True, room=0.02))
    context = dut.CreateDefaultContext()
    push = Touched((0.0, 5.0, 0.0), 1.0, 1.0)
    for name, value in (
        ("v_safe", Velocity(ONWARDS)),
        ("guide", example(Guide)._replace(s=1.0)),
        ("touch", push),
    ):
        dut.GetInputPort(name).FixValue(context, flat(value))
    tip, ways = np.array(TOOL.tip), []
    for k in range(120):
        # Its first answer is to a tool that nothing pushes.
        told = push if k > 0 else push._replace(touched=0.0)
        dut.GetInputPort("touch").FixValue(context, flat(told))
        place = RobotTool(TOOL.fulcrum, tuple(tip))
        dut.GetInputPort("robot_tool").FixValue(context, flat(place))
        v = view(Velocity, dut.GetOutputPort("v_R").Eval(context)).v if k > 0 else 0.0
        tip = tip + np.multiply(v, 1.0 / 60.0)
        update = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(update)
        ways.append(np.linalg.norm(tip - TOOL.tip))
    assert 0.018 < ways[-1] < 0.022 and max(ways) < 0.0225
    assert ways[-1] == pytest.approx(ways[-2], abs=1e-4)


def test_a_withdrawal_goes_on():
    (v, _), *_ = steps([Touched((0.0, 0.2, 0.0), 0.5, 1.0)], v_safe=(0.02, 0.0, 0.05))
    assert v[2] == pytest.approx(0.1)
    assert v[0] == pytest.approx(0.0)


def test_the_task_waits_a_while_after():
    pushed = [Touched((0.0, 1.0, 0.0), 1.0, 1.0)] * 5
    free = [Touched((0.0, 0.0, 0.0), 1.0, 0.0)] * 60
    codes = [code for _, code in steps(pushed + free)]
    waited = codes[5:].index(0.0) * PARAMS.period
    assert waited == pytest.approx(PARAMS.wait, abs=2 * PARAMS.period)
