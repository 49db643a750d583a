"""Endoscope: it follows S slowly through its fulcrum, and rests when S is unknown."""

import math

import numpy as np
import pytest

from systems.common.signal import example, flat, view
from systems.common.signals import Estimate
from systems.motion.endoscope import (
    Endoscope,
    EndoscopeParams,
    constants,
    follow,
    wanted_tip,
)

PARAMS = EndoscopeParams()
RECORD = constants(PARAMS)[0]
START = [*wanted_tip(RECORD, tuple(PARAMS.p_WS)), 0.0, 0.0, 0.0]


def drive(targets, state=START):
    states = [state]
    for target in targets:
        p, v = tuple(states[-1][:3]), tuple(states[-1][3:])
        point = (0.0, 0.0, 0.0) if target is None else tuple(target)
        p, v = follow(RECORD, p, v, point, target is not None)
        states.append([*p, *v])
    return np.array(states)


def test_it_comes_to_look_at_the_target_from_the_standoff():
    target = np.array([0.05, 0.02, -0.15])
    states = drive([target.tolist()] * 900)
    tip, G_C = states[-1, :3], np.array(PARAMS.p_WG)
    assert np.linalg.norm(target - tip) == pytest.approx(PARAMS.standoff, abs=1e-5)
    assert np.linalg.norm(np.cross(tip - G_C, target - G_C)) < 1e-6


def test_it_is_slow_and_smooth_and_does_not_overshoot():
    target = [0.06, 0.02, -0.15]
    states = drive([target] * 900)
    speed = np.linalg.norm(states[:, 3:], axis=1)
    assert speed.max() == pytest.approx(PARAMS.max_speed, rel=1e-6)
    change = np.linalg.norm(np.diff(states[:, 3:], axis=0), axis=1) / PARAMS.period
    assert change.max() <= PARAMS.max_acceleration * (1 + 1e-9)
    moved = np.diff(states[:, :3], axis=0) / PARAMS.period
    np.testing.assert_allclose(moved, states[1:, 3:], atol=1e-9)
    gap = np.linalg.norm(states[:, :3] - wanted_tip(RECORD, tuple(target)), axis=1)
    assert (np.diff(gap) < 1e-9).all()


def test_it_comes_to_rest_while_the_target_is_unknown():
    states = drive([[0.06, 0.02, -0.15]] * 60 + [None] * 60)
    assert np.linalg.norm(states[60, 3:]) > 0.02
    assert not states[-1, 3:].any()
    assert np.linalg.norm(states[-1, :3] - states[60, :3]) < 0.01


def test_it_stays_inside_near_its_fulcrum():
    G_C = np.array(PARAMS.p_WG)
    down = np.array([0.0, 0.0, -1.0])
    near = wanted_tip(RECORD, tuple(G_C + 0.05 * down))
    np.testing.assert_allclose(near, G_C + PARAMS.min_insertion * down)
    far = wanted_tip(RECORD, tuple(G_C + 0.9 * down))
    np.testing.assert_allclose(far, G_C + PARAMS.max_insertion * down)


def test_cone_and_shaft_of_the_block():
    dut = Endoscope()
    context = dut.CreateDefaultContext()
    for known in (1.0, 0.0):
        target = example(Estimate)._replace(p=(0.06, 0.02, -0.15), known=known)
        dut.GetInputPort("target").FixValue(context, flat(target))
        for _ in range(30):
            update = dut.EvalUniquePeriodicDiscreteUpdate(context)
            state = [update.value(group).copy() for group in range(3)]
            for group, vector in enumerate(state):
                context.SetDiscreteState(group, vector)
            cone, shaft, camera = (
                view(signal, dut.GetOutputPort(name).Eval(context))
                for name, signal in dut.signals.items()
                if name != "target"
            )
            np.testing.assert_array_equal(cone.apex, shaft.tip)
            np.testing.assert_array_equal(cone.u, shaft.u)
            np.testing.assert_array_equal(cone.apex, camera.p)
            assert cone.half == PARAMS.half_angle
            assert np.linalg.norm(cone.u) == pytest.approx(1.0)
            assert np.linalg.norm(np.cross(cone.apex - PARAMS.p_WG, cone.u)) < 1e-12
            np.testing.assert_array_equal(camera.fulcrum, PARAMS.p_WG)
            assert camera.known == 1.0
        assert (np.linalg.norm(camera.v) > 0.01) == (known == 1.0)


def test_target_that_is_not_finite_is_not_followed():
    dut = Endoscope()
    context = dut.CreateDefaultContext()
    target = example(Estimate)._replace(p=(math.nan, 0.02, -0.15))
    dut.GetInputPort("target").FixValue(context, flat(target))
    update = dut.EvalUniquePeriodicDiscreteUpdate(context)
    camera = view(Estimate, update.value(2))
    np.testing.assert_allclose(camera.p, START[:3])
    np.testing.assert_array_equal(camera.v, START[3:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period": 0.0}, "period"),
        ({"p_WG": [0.0]}, "p_WG.*3 numbers"),
        ({"p_WS": [0.0, 0.0, math.nan]}, "p_WS.*3 numbers"),
        ({"p_WS": [0.0, 0.0, 0.1]}, "p_WS=.*below p_WG"),
        ({"standoff": -0.07}, "standoff"),
        ({"max_insertion": 0.01}, "max_insertion"),
        ({"half_angle": 35.0}, "half_angle=35.0 rad: .*<= 1.5"),
        ({"rate": 100.0}, "rate=100.0 1/s: expected > 0 and <= 20"),
        ({"rate": 10.0, "period": 0.2}, "rate=10.0 1/s: expected less than 1 / period"),
        ({"max_speed": math.inf}, "max_speed"),
        ({"max_acceleration": 0.01}, "max_acceleration=0.01 m/s.2: .*at least.*0.045"),
    ],
)
def test_bad_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Endoscope(EndoscopeParams(**changes))
