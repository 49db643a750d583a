"""The bypass as a whole: kinematic scenes, waiting, several tools, the block."""

import numpy as np
import pytest

from diagrams.gauze.kinematic_planners import NO_CONE, ROOM
from diagrams.gauze.scenes import CONTACT, scene
from systems.bypass.bypass_route import OVER, STRAIGHT, choose_way
from systems.bypass.shadow_body import COLUMNS, FULCRUM, PLAN, SAFE, TIP
from systems.bypass.tool_bypass import (
    ToolBypass,
    ToolBypassParams,
    constants,
)
from systems.common import geometry

G = (0.0, 0.0, 0.0)
RECORD = constants(ToolBypassParams())[0]


def tools(*pairs) -> np.ndarray:
    """Obstacle tools at rest from (fulcrum, tip) pairs."""
    rows = np.zeros((len(pairs), COLUMNS))
    for row, (a, tip) in zip(rows, pairs, strict=True):
        row[TIP : TIP + 3], row[FULCRUM : FULCRUM + 3] = tip, a
        row[SAFE], row[PLAN] = 0.007, 0.0095
    return rows


def chosen(p, goal, rows, edge=STRAIGHT, waits=0):
    """The way at one instant, in a workspace without borders."""
    return choose_way(RECORD, ROOM, NO_CONE, G, p, goal, rows, edge, waits)


def test_a_free_way_is_straight_and_a_crossed_one_goes_over_an_edge():
    p, goal = (-0.05, 0.0, -0.06), (0.05, 0.0, -0.06)
    aside = tools(((0.0, 0.1, 0.0), (0.0, 0.05, -0.05)))
    direction, length, edge, waits, aim = chosen(p, goal, aside)
    assert (edge, waits, aim) == (STRAIGHT, 0, goal)
    assert direction == pytest.approx((1.0, 0.0, 0.0)) and length == pytest.approx(0.1)
    across = tools(((0.0, 0.1, 0.0), (0.0, -0.03, -0.055)))
    _, length, edge, waits, _ = chosen(p, goal, across)
    assert edge in (1, 2) and not waits and length > 0.1


def test_the_edge_in_use_is_kept_until_another_is_clearly_shorter():
    p, goal = (-0.05, 0.0, -0.06), (0.05, 0.0, -0.06)
    across = tools(((0.0, 0.1, 0.0), (0.0, -0.012, -0.055)))
    first = chosen(p, goal, across)[2]
    other = 3 - first
    lengths = {first: chosen(p, goal, across)[1]}
    kept = chosen(p, goal, across, edge=other)
    lengths[kept[2]] = kept[1]
    if kept[2] == other:
        assert lengths[first] > 0.85 * lengths[other] - 0.005
    else:
        assert lengths[first] < lengths[first] / 0.85


def test_where_no_edge_will_do_it_retracts_turns_and_inserts():
    """A grid of tools that leaves room only near the fulcrum."""
    p, goal = (-0.08, 0.0, -0.1), (0.08, 0.0, -0.1)
    fence = tools(
        ((0.0, 0.15, -0.01), (0.0, -0.12, -0.055)),
        ((0.008, -0.15, -0.01), (0.008, 0.12, -0.058)),
        ((-0.008, -0.15, -0.02), (-0.008, 0.12, -0.062)),
    )
    edge, waits, met = STRAIGHT, 0, set()
    for _ in range(4000):
        direction, length, edge, waits, _ = chosen(p, goal, fence, edge, waits)
        met.add(edge)
        if length < 1e-3:
            break
        p = geometry.along(p, min(1e-4, length), direction)
        rho = min(
            geometry.closest_points(
                G, p, tuple(r[FULCRUM : FULCRUM + 3]), tuple(r[:3])
            )[2]
            for r in fence
        )
        assert rho > 0.0065
    assert geometry.norm(geometry.sub(p, goal)) < 2e-3
    assert not waits and met - {STRAIGHT}


def test_it_waits_at_a_free_pose_near_the_target():
    for number in range(30):
        given = scene("blocked", 2, number)
        a, tip = given.p_WGo, given.legs[0].p0
        row = tools((a, tip))
        _, _, _, waits, aim = choose_way(
            RECORD,
            ROOM,
            NO_CONE,
            given.p_WGr,
            given.p_WPr,
            given.p_WPs,
            row,
            STRAIGHT,
            0,
        )
        assert waits
        rho = geometry.closest_points(given.p_WGr, aim, a, tip)[2]
        assert rho > 0.0075
        # No free pose is much nearer to the target: 28 mm is the price of the detours.
        rng = np.random.default_rng(number)
        poses = np.array(given.p_WPs) + rng.uniform(-0.08, 0.08, (4000, 3))
        free = [
            float(np.linalg.norm(x - given.p_WPs))
            for x in poses
            if geometry.closest_points(given.p_WGr, tuple(x), a, tip)[2] > 0.008
            and x[2] > -0.065
        ]
        assert geometry.norm(geometry.sub(aim, given.p_WPs)) < min(free) + 0.03


def fixed(dut):
    """A context with the examples at the inputs."""
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    return context


def test_the_block_runs_down_while_a_tool_is_lost():
    dut = ToolBypass()
    context = fixed(dut)
    state = context.get_mutable_discrete_state_vector()
    state.SetFromVector([0.05, 0.0, 0.0, -1.0 / 60.0, 0.0, 0.0, 0.0])
    lost = np.array(dut.GetInputPort("obstacle").Eval(context))
    lost[15] = 0.0
    dut.GetInputPort("obstacle").FixValue(context, lost)
    guide = dut.GetOutputPort("guide").Eval(context)
    v1 = dut.GetOutputPort("v1").Eval(context) / guide[7]
    assert np.linalg.norm(v1) == pytest.approx(0.05 - 1.0 / 60.0, abs=1e-9)
    lost[:] = np.nan
    dut.GetInputPort("obstacle").FixValue(context, lost)
    for name in ("v1", "guide", "way"):
        assert np.isfinite(dut.GetOutputPort(name).Eval(context)).all()


def test_the_block_starts_off_with_bounded_acceleration():
    dut = ToolBypass()
    context = fixed(dut)
    guide = dut.GetOutputPort("guide").Eval(context)
    v1 = dut.GetOutputPort("v1").Eval(context) / guide[7]
    assert 0.0 < np.linalg.norm(v1) <= 1.0 / 60.0 + 1e-9


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match=r"max_speed=nan must be finite"):
        ToolBypass(ToolBypassParams(max_speed=float("nan")))
    with pytest.raises(ValueError, match=r"freed_room=0.0001 m .* must increase"):
        ToolBypass(ToolBypassParams(freed_room=0.0001))
    with pytest.raises(ValueError, match=r"switch_ratio=1.5 must be in \(0, 1\]"):
        ToolBypass(ToolBypassParams(switch_ratio=1.5))


def test_contact_is_five_millimetres():
    assert CONTACT == 0.005
    assert OVER < STRAIGHT
