"""A tool that is lost: R gets out along its shaft before it can be there."""

import numpy as np
import pytest

from diagrams.gauze.kinematic_loop import estimate
from diagrams.gauze.kinematic_planners import NO_CONE
from systems.bypass.clearance_constraint import (
    ClearanceConstraint,
    ClearanceConstraintParams,
)
from systems.common.geometry import along, closest_points, norm, plus, scaled, sub, unit
from systems.common.signal import example, flat
from systems.common.signals import CALM, FREE, Guide, RobotTool

G, P = (0.0, 0.0, 0.0), (0.0, 0.0, -0.12)
G_O, DT, V_O = (0.0, 0.12, 0.0), 1.0 / 60.0, 0.06
FAR = estimate((0.3, 0.0, -0.1), (0.3, 0.0, 0.0))
TIP = (0.0, 0.06, -0.12)


def block(**params):
    """The block and its context; O is seen and R would not move."""
    dut = ClearanceConstraint(ClearanceConstraintParams(**params))
    context = dut.CreateDefaultContext()
    for name, signal in {
        "guide": example(Guide)._replace(s=1.0),
        "obstacles": estimate(TIP, G_O),
        "target": FAR,
        "camera": FAR,
        "view_cone": NO_CONE,
        "permission": FREE,
        "robot_tool": RobotTool(G, P),
        "v_R": (0.0, 0.0, 0.0),
    }.items():
        dut.GetInputPort(name).FixValue(context, flat(signal))

    def v_safe(p=P, **told):
        hidden = estimate(told.pop("tip", TIP), G_O)._replace(**told)
        dut.GetInputPort("obstacles").FixValue(context, flat(hidden))
        dut.GetInputPort("robot_tool").FixValue(context, flat(RobotTool(G, p)))
        return (
            dut.GetOutputPort("v_safe").Eval(context),
            dut.GetOutputPort("status").Eval(context),
        )

    return v_safe


def test_it_withdraws_once_the_tool_could_be_near_and_not_before():
    v_safe = block()
    for age, withdraws in ((0.0, 0), (0.09, 0), (0.3, 0), (0.5, 1), (1.0, 1)):
        v, status = v_safe(known=0.0, age=age)
        np.testing.assert_allclose(v, (0.0, 0.0, 0.25 * withdraws), atol=1e-12)
        assert status[3] == status[6] == withdraws
    for told in ({"sigma_p": 1.0}, {"p": (np.nan, 0.0, 0.0)}):
        v, status = v_safe(known=0.0, age=1.0, **told)
        np.testing.assert_array_equal(status, flat(CALM))
        assert not v.any()
    v, _ = block(dodge=False)(known=0.0, age=1.0)
    assert not v.any()


def test_an_estimate_that_is_still_known_is_evaded_beside_it():
    near = (0.0, 0.011, -0.12)
    v, status = block()(known=1.0, age=0.15, tip=near, v=(0.0, -0.05, 0.0))
    assert v[2] > 0.2 and v[1] < -0.01 and status[3] == 1.0


@pytest.mark.parametrize("withdraws", [True, False])
def test_hands_that_come_unseen_meet_it_only_where_it_stands(withdraws):
    """From 200 places, as fast as V_O, seen last 26 to 40 mm away.

    To be 40 mm out takes it 0.35 s, in which a hand comes by 21 mm; axes touch at 5.
    """
    rng = np.random.default_rng(3)
    v_safe, met = block(dodge=withdraws), 0
    for _ in range(200):
        way = unit(tuple(rng.normal(size=3)))
        tip = last = along(P, rng.uniform(0.026, 0.04), way)
        if closest_points(G, P, G_O, last).distance < 0.026:
            continue
        goal = along(P, rng.uniform(0.0, 0.04), (0.0, 0.0, 1.0))
        p, v, low = P, (0.0, 0.0, 0.0), 1.0
        for k in range(90):
            tip = along(tip, V_O * DT, unit(sub(goal, tip)))
            wanted, _ = v_safe(p, tip=last, known=float(k < 15), age=k * DT)
            change = sub(tuple(wanted), v)
            v = plus(v, scaled(min(1.0, 4.0 * DT / max(norm(change), 1e-9)), change))
            p = along(p, DT, v) if norm(p) > 0.02 else p
            low = min(low, closest_points(G, p, G_O, tip).distance)
        met += low < 0.005
    assert met == 0 if withdraws else met > 50
