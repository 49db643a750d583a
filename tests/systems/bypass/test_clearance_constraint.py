"""The clearance constraint: the distance's rate, the promise, and the block."""

import numpy as np
import pytest

from diagrams.gauze.kinematic_loop import estimate
from diagrams.gauze.kinematic_planners import NO_CONE
from systems.bypass import clearance_constraint, obstacle_tools, workspace
from systems.bypass.clearance_constraint import (
    ClearanceConstraint,
    ClearanceConstraintParams,
)
from systems.bypass.distance_rate import distance_rate, outer_rate
from systems.bypass.obstacle_tools import Margins
from systems.bypass.safe_velocity import constrain
from systems.bypass.shadow_body import ObstacleTool, pose_distance, read_tool
from systems.bypass.workspace import WorkspaceParams
from systems.common import geometry
from systems.common.reach_limits import ReachLimits
from systems.common.signal import example, flat
from systems.common.signals import CALM, FREE, Estimate, Guide, RobotTool, ViewCone
from systems.passive_wrist.wall_model import lateral_basis

G = (0.0, 0.0, 0.0)
RECORD = clearance_constraint.constants(ClearanceConstraintParams())[0]
INSIDE = clearance_constraint.constants(ClearanceConstraintParams(outside=0.0))[0]
ROOM = workspace.constants(ReachLimits(max_tilt=3.1), WorkspaceParams(floor=-0.5))[0]
NOT_DODGING = np.zeros(3)
STILL = np.zeros((4, 3))


def tool(a, tip, v=(0.0, 0.0, 0.0)) -> ObstacleTool:
    """An obstacle tool."""
    return ObstacleTool(tip, v, a, 0.007, 0.0095)


def rows(*tools):
    """Obstacle tools as the constraint takes them."""
    return np.array([flat(one) for one in tools])


def moved(p, v, dt):
    """A tool's tip after dt."""
    return geometry.along(p, dt, v)


def test_the_rate_agrees_with_finite_differences():
    rng = np.random.default_rng(1)
    dt, compared = 1e-6, 0
    for _ in range(2000):
        a, tip, p = (tuple(rng.uniform(-0.1, 0.1, 3)) for _ in range(3))
        v_o, v = (tuple(rng.uniform(-0.1, 0.1, 3)) for _ in range(2))
        now = distance_rate(G, p, tool(a, tip, v_o))
        fraction = geometry.closest_points(G, p, a, tip).t
        # A fulcrum is no material point.
        if now.rho < 1e-3 or now.s < 1e-6 or fraction < 1e-6:
            continue
        before, after = (
            geometry.closest_points(
                G, moved(p, v, k * dt), a, moved(tip, v_o, k * dt)
            ).distance
            for k in (-1, 1)
        )
        rate = (after - before) / (2.0 * dt)
        assert geometry.dot(now.A, v) - now.c == pytest.approx(rate, abs=1e-5)
        compared += 1
    assert compared > 800


def test_the_shafts_outside_the_body_are_kept_apart_as_well():
    """Inside they are far from each other, above the wall O's comes for R's."""
    a, v_o, dt = (-0.06, 0.03, 0.0), (0.0, 0.02, 0.0), 1.0 / 240.0
    lows = []
    for record in (RECORD, INSIDE):
        p, tip, low = (0.05, 0.0, -0.1), (-0.09, 0.03, -0.1), 1.0
        for _ in range(480):
            o = tool(a, tip, v_o)
            v, _, _ = constrain(
                record, ROOM, NO_CONE, G, p, G, rows(o), NOT_DODGING, STILL
            )
            p, tip = moved(p, v, dt), moved(tip, v_o, dt)
            ends = [
                geometry.along(g, -0.3, geometry.unit(geometry.sub(x, g)))
                for g, x in ((G, p), (a, tip))
            ]
            low = min(low, geometry.closest_points(G, ends[0], a, ends[1]).distance)
        lows.append(low)
    assert lows[0] > 0.0069
    assert lows[1] < 0.005


def test_a_fulcrum_that_moves_as_fast_as_it_may_comes_near_as_gamma_allows():
    """R turns about its tip; above the wall, where it swings most, O stands."""
    a, p, dt = (-0.06, 0.03, 0.0), (0.05, 0.005, -0.1), 1e-4
    o = tool(a, (-0.09, 0.03, -0.1))
    _, _, status = constrain(
        RECORD, ROOM, NO_CONE, G, p, G, rows(o), NOT_DODGING, STILL
    )
    assert status.forth == 1.0 and 0.0 < status.back < 0.1
    e, _ = lateral_basis(geometry.unit(geometry.sub(p, G)))
    g = geometry.scaled(-dt * status.back, e)
    before, after = (outer_rate(where, p, o, 0.3).rho - o.safe for where in (G, g))
    assert (after - before) / dt == pytest.approx(-RECORD["rate"] * before, rel=0.01)


def test_the_view_gives_way_to_a_tool_and_nothing_else():
    p, a, tip = (0.0, 0.0, -0.12), (0.02, 0.09, 0.0), (0.013, -0.05, -0.08)
    low = ViewCone((0.002, 0.0, -0.112), (0.0, 0.0, -1.0), 0.5)
    sweep = rows(tool(a, tip, (-0.2, 0.0, 0.0)))
    v, _, status = constrain(
        RECORD, ROOM, low, G, p, (0.0, 0.0, 0.0), sweep, NOT_DODGING, STILL
    )
    assert v[2] > 0.1 and status.blind == 1.0 == status.escape
    away = rows(tool((0.3, 0.3, 0.0), (0.3, 0.3, -0.05)))
    v, _, status = constrain(
        RECORD, ROOM, low, G, p, (0.0, 0.0, 0.1), away, NOT_DODGING, STILL
    )
    assert status.blind == 0.0 == status.escape
    assert v[2] < 0.09 and status.change > 0.01


def test_a_tool_that_drives_the_tip_into_a_border_is_dodged_in_time():
    """Slow enough to be carried along, but not for ever: the tilt ends it."""
    p, a, tip = (0.078, 0.0, -0.1), (0.0, 0.11, 0.0), (0.022, -0.05, -0.05)
    room = workspace.constants(ReachLimits(max_tilt=0.7), WorkspaceParams())[0]
    row = rows(tool(a, tip, (0.02, 0.0, 0.01)))
    rate = distance_rate(G, p, read_tool(row[0]))
    assert 0.0 < rate.c < 0.02 and 0.2 < rate.s < 0.9
    _, _, status = constrain(RECORD, room, NO_CONE, G, p, G, row, NOT_DODGING, STILL)
    assert status.dodge == 1.0
    _, _, status = constrain(RECORD, ROOM, NO_CONE, G, p, G, row, NOT_DODGING, STILL)
    assert status.dodge == 0.0


def test_what_is_safe_passes_unchanged():
    far = tool((0.1, 0.1, 0.0), (0.08, 0.1, -0.1))
    wanted = (0.03, 0.01, -0.02)
    v, _, status = constrain(
        RECORD,
        ROOM,
        NO_CONE,
        G,
        (0.0, 0.0, -0.1),
        wanted,
        rows(far),
        NOT_DODGING,
        STILL,
    )
    assert v == pytest.approx(wanted, abs=1e-12)
    assert status.near == 0.0 and status.condition == 1.0 and status.change < 1e-9


def test_the_distance_is_held_against_a_tool_that_evasion_can_match():
    """O sweeps the shaft's inside with less than s v: D_safe is kept."""
    p, tip, dt = (0.0, 0.0, -0.12), (0.03, -0.02, -0.11), 1.0 / 240.0
    a, v_o = (0.03, 0.09, 0.0), (-0.03, 0.0, 0.0)
    low, dodging, held = 1.0, NOT_DODGING, True
    for _ in range(600):
        row = rows(tool(a, tip, v_o))
        v, dodging, status = constrain(
            RECORD, ROOM, NO_CONE, G, p, (0.02, 0.0, 0.0), row, dodging, STILL
        )
        held = held and status.condition > 0.5
        p, tip = moved(p, v, dt), moved(tip, v_o, dt)
        low = min(low, geometry.closest_points(G, p, a, tip).distance)
    assert held
    assert low > 0.007 - 5e-5
    assert p[0] < -0.01  # it was carried along


def test_a_sweep_that_is_too_fast_is_told_and_dodged():
    p, a, tip = (0.0, 0.0, -0.12), (0.02, 0.09, 0.0), (0.013, -0.05, -0.08)
    row = rows(tool(a, tip, (-0.2, 0.0, 0.0)))
    v, dodging, status = constrain(
        RECORD, ROOM, NO_CONE, G, p, (0.0, 0.0, 0.0), row, NOT_DODGING, STILL
    )
    assert status.near == 1.0 and status.condition == 0.0
    assert dodging[0] == 1.0 == status.dodge
    assert v[0] < 0.0 and v[2] > 0.0  # away from O, and out of its way


def test_the_borders_of_the_workspace_hold():
    away = rows(tool((0.3, 0.3, 0.0), (0.3, 0.3, -0.05)))
    reach = ReachLimits(max_tilt=0.5)
    room = workspace.constants(reach, WorkspaceParams(floor=-0.1))[0]
    for p, wanted, axis in (
        ((0.0, 0.0, -0.0999), (0.0, 0.0, -0.1), (0.0, 0.0, -1.0)),
        ((0.0, 0.0, -0.0301), (0.0, 0.0, 0.1), (0.0, 0.0, 1.0)),
    ):
        v, _, _ = constrain(
            RECORD, room, NO_CONE, G, p, wanted, away, NOT_DODGING, STILL
        )
        assert geometry.dot(v, axis) < 1e-3
    tilted = (0.1 * np.sin(0.4999), 0.0, -0.1 * np.cos(0.4999))
    v, _, _ = constrain(
        RECORD, room, NO_CONE, G, tilted, (0.1, 0.0, 0.0), away, NOT_DODGING, STILL
    )
    assert v[0] < 0.07
    angle = np.arctan2(tilted[0] + 0.01 * v[0], -(tilted[2] + 0.01 * v[2]))
    assert angle < 0.5005


def test_it_keeps_clear_of_three_obstacles():
    """R is sent at one after the other, and then between two of them."""
    obstacles = [
        estimate((0.02, 0.02, -0.13), (0.09, 0.09, 0.0)),
        estimate((-0.02, 0.02, -0.13), (-0.09, 0.09, 0.0)),
        estimate((0.0, -0.025, -0.13), (0.0, -0.12, 0.0)),
    ]
    far = estimate((0.3, 0.0, -0.1), (0.3, 0.0, 0.0))
    dut = ClearanceConstraint(obstacles=("right", "left", "front"))
    context = dut.CreateDefaultContext()
    for name, signal in {
        "guide": example(Guide)._replace(s=1.0),
        "obstacles": tuple(obstacles),
        "target": far,
        "camera": far,
        "view_cone": NO_CONE,
        "permission": FREE,
    }.items():
        dut.GetInputPort(name).FixValue(context, flat(signal))
    p, near = (0.0, 0.0, -0.12), np.full(3, np.inf)
    for goal in [*(tool.p for tool in obstacles), (0.0, 0.05, -0.12)]:
        for _ in range(120):
            wanted = geometry.scaled(2.0, geometry.sub(goal, p))
            robot = RobotTool(G, p)
            dut.GetInputPort("robot_tool").FixValue(context, flat(robot))
            dut.GetInputPort("v_R").FixValue(context, wanted)
            v = dut.GetOutputPort("v_safe").Eval(context)
            p = moved(p, tuple(v), 1.0 / 60.0)
            near = np.minimum(
                near,
                [
                    geometry.closest_points(G, p, o.fulcrum, o.p).distance
                    for o in obstacles
                ],
            )
    # It was near to each, and never nearer than D_safe.
    assert (near < 0.0075).all() and (near > 0.007 - 1e-4).all()


@pytest.mark.parametrize("place", range(3))
def test_one_of_three_that_is_lost_cannot_be_judged(place):
    dut = ClearanceConstraint(obstacles=("right", "left", "front"))
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    assert dut.GetOutputPort("status").Eval(context)[2] == 1.0
    for bad in ({"known": 0.0}, {"p": (np.nan, 0.0, 0.0)}):
        obstacles = [example(Estimate)] * 3
        obstacles[place] = obstacles[place]._replace(**bad)
        dut.GetInputPort("obstacles").FixValue(context, flat(tuple(obstacles)))
        v_R = dut.GetInputPort("v_R").Eval(context)
        np.testing.assert_array_equal(dut.GetOutputPort("v_safe").Eval(context), v_R)
        status = dut.GetOutputPort("status").Eval(context)
        np.testing.assert_array_equal(status, flat(CALM))


def test_margins_follow_the_uncertainty_and_s_is_spared_at_its_tip():
    record = obstacle_tools.constants(Margins())[0]
    o = estimate((0.0, 0.05, -0.1), (0.0, 0.1, 0.0))
    s = estimate((0.05, 0.0, -0.1), (0.1, 0.0, 0.0))
    c = estimate((0.0, -0.05, -0.05), (0.0, -0.1, 0.0))

    def around(*obstacles):
        estimates = np.array([*map(flat, obstacles)])
        tools = obstacle_tools.obstacle_tools(record, G, estimates, s, c)
        return [*map(read_tool, tools)]

    sure = around(o)
    assert len(sure) == 3
    assert sure[0].safe == Margins().safe_distance
    assert sure[2].safe == Margins().camera_distance
    o = o._replace(sigma_p=3e-4, sigma_v=0.01)
    unsure = around(o)
    extra = 3.0 * np.hypot(3e-4, 0.03 * 0.01)
    assert unsure[0].safe - sure[0].safe == pytest.approx(extra)
    # Every obstacle has a row of its own, before S and the endoscope.
    three = around(o, s, c)
    assert [tool.tip for tool in three[:3]] == [o.p, s.p, c.p]
    assert three[3:] == sure[1:]
    # The final pose keeps the distance that is planned with from what is left of S.
    rho = pose_distance(sure[1], G, (0.05, 0.0, -0.1))
    assert rho == pytest.approx(Margins().plan_distance + 1e-3, abs=1e-4)


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match=r"rate=-1.0 1/s: expected >= 0.1 and <= 60"):
        ClearanceConstraint(ClearanceConstraintParams(rate=-1.0))
    with pytest.raises(ValueError, match=r"rate=60.0 1/s: expected at most .* = 30"):
        ClearanceConstraint(ClearanceConstraintParams(rate=60.0))
    with pytest.raises(ValueError, match=r"plan_distance=0.005 m: expected more than"):
        ClearanceConstraint(margins=Margins(plan_distance=0.005))
    with pytest.raises(ValueError, match=r"reach_limits.max_tilt=40.0 rad: expected"):
        ClearanceConstraint(reach=ReachLimits(max_tilt=40.0))


def test_the_block_lets_pass_what_it_cannot_judge():
    dut = ClearanceConstraint()
    context = dut.CreateDefaultContext()
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        port.FixValue(context, dut.AllocateInputVector(port).value())
    lost = example(Estimate)._replace(known=0.0)
    dut.GetInputPort("obstacles").FixValue(context, flat(lost))
    wanted = [0.01, 0.02, 0.03]
    dut.GetInputPort("v_R").FixValue(context, wanted)
    np.testing.assert_allclose(dut.GetOutputPort("v_safe").Eval(context), wanted)
    status = dut.GetOutputPort("status").Eval(context)
    np.testing.assert_array_equal(status, flat(CALM))
