"""Obstacles' motion, and the crowd."""

from math import hypot, nan

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from plants.crowd.crowd_motion import CrowdMotion, CrowdParams, starts
from plants.crowd.obstacle_motion import ObstacleMotion, ObstacleParams, obstacle_at
from plants.crowd.orca import orca_towards, orca_velocity
from plants.crowd.signals import OBSTACLES, Obstacle
from plants.crowd.social_force import social_force_towards
from systems.common.signal import view


def test_bouncing_is_the_motion_stepped_through():
    o = ObstacleParams(
        motion="bouncing",
        radius=0.3,
        start=[1.0, 0.5],
        velocity=[0.7, -0.4],
        box=[0.0, 0.0, 3.0, 2.0],
    )
    x, y, u, v = 1.0, 0.5, 0.7, -0.4
    dt = 1e-3
    for k in range(20_000):
        if k % 500 == 0:
            now = obstacle_at(o, k * dt)
            assert (now.x, now.y) == pytest.approx((x, y), abs=2e-2)
            assert now.radius == 0.3 and abs(now.v_x) == 0.7 and abs(now.v_y) == 0.4
        x, y = x + dt * u, y + dt * v
        u = abs(u) if x < 0.3 else -abs(u) if x > 2.7 else u
        v = abs(v) if y < 0.3 else -abs(v) if y > 1.7 else v


def test_waypoints_and_their_velocity():
    o = ObstacleParams(
        motion="waypoints", times=[1.0, 3.0], points=[[0.0, 0.0], [1.0, 2.0]]
    )
    assert obstacle_at(o, 0.0) == Obstacle(0.0, 0.0, 0.3, 0.0, 0.0)
    assert obstacle_at(o, 2.0) == Obstacle(0.5, 1.0, 0.3, 0.5, 1.0)
    assert obstacle_at(o, 9.0) == Obstacle(1.0, 2.0, 0.3, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, r"obstacles\[1\].radius=0.0 m: expected > 0"),
        ({"radius": -1.0}, r"radius=-1.0 m: expected > 0"),
        ({"start": [nan, 0.0]}, r"start=\[nan, 0.0\] m: expected 2 numbers"),
        ({"start": [1e9, 0.0]}, "start=.* <= 100"),
        ({"start": [1.0]}, r"start=\[1.0\] m: expected 2 numbers"),
        ({"motion": "hopping"}, r"motion='hopping': expected one of straight"),
        ({"motion": "waypoints"}, "times=.*as many rising times as points"),
        (
            {"motion": "waypoints", "times": [1.0, 1.0], "points": [[0.0, 0.0]] * 2},
            r"times=\[1.0, 1.0\] s: expected as many rising times",
        ),
        ({"motion": "bouncing", "start": [50.0, 0.0]}, "start=.*its x in the box"),
        ({"motion": "bouncing", "start": [5.0, 4.9]}, "start=.*its y in the box"),
    ],
)
def test_bad_obstacles_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        ObstacleMotion([ObstacleParams(), ObstacleParams(**change)])


def test_a_world_may_be_empty_or_full_but_no_more():
    dut = ObstacleMotion([])
    rows = view(OBSTACLES, dut.GetOutputPort("obstacles").Eval(dut.AllocateContext()))
    assert len(rows.radius) == 40 and not rows.radius.any()
    assert len(ObstacleMotion().obstacles) == 1
    with pytest.raises(ValueError, match="obstacles: 41 of them: expected <= 40"):
        ObstacleMotion([ObstacleParams()] * 41)


def test_two_who_meet_give_way_to_each_other():
    a = Obstacle(0.0, 0.0, 0.3, 1.0, 0.0)
    b = Obstacle(3.0, 0.1, 0.3, -1.0, 0.0)
    va = orca_velocity(a, [b], (1.0, 0.0), 1.0)
    vb = orca_velocity(b, [a], (-1.0, 0.0), 1.0)
    assert va[1] < 0.0 < vb[1]
    # Together they miss each other for five seconds.
    t = np.linspace(0.0, 5.0, 200)
    gap = np.hypot(3.0 + t * (vb[0] - va[0]), 0.1 + t * (vb[1] - va[1]))
    assert gap.min() > 0.6 - 1e-6


def test_a_crowd_crosses_without_touching():
    people = starts(CrowdParams(people=8, speed=1.0, seed=2))
    goals = [(-o.x, -o.y) for o in people]
    least = 9.0
    for _ in range(80):
        moves = orca_towards(people, goals, 1.0)
        people = [
            Obstacle(o.x + 0.25 * u, o.y + 0.25 * v, o.radius, u, v)
            for o, (u, v) in zip(people, moves, strict=True)
        ]
        places = np.array([(o.x, o.y) for o in people])
        gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        least = min(least, gaps[~np.eye(8, dtype=bool)].min())
    assert least > 0.6
    assert np.abs(places - goals).max() < 0.3


def test_the_block_walks_as_the_crowd_does():
    params = CrowdParams(people=5, seed=2, x=1.0, y=-2.0)
    dut = CrowdMotion(params)
    simulator = Simulator(dut)
    context = simulator.get_context()
    port = dut.GetOutputPort("obstacles")
    people = starts(params)
    now = view(OBSTACLES, port.Eval(context))
    assert now.x[:5].tolist() == [o.x for o in people] and not now.radius[5:].any()
    simulator.AdvanceTo(0.1)  # the first decision was at time zero
    moves = orca_towards(people, dut.goals, params.speed, 5.0, 0.25)
    now = view(OBSTACLES, port.Eval(context))
    expected = [o.y + 0.1 * v for o, (_, v) in zip(people, moves, strict=True)]
    assert now.y[:5] == pytest.approx(expected)
    assert now.v_x[:5].tolist() == [u for u, _ in moves]
    assert now.radius[:5].tolist() == [0.3] * 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"people": 100}, r"crowd.people=100: expected >= 0 and <= 40"),
        ({"people": 24, "radius": 0.6}, "crowd.people=24: expected <= 14: no more fit"),
        ({"people": -1}, r"crowd.people=-1: expected >= 0"),
        ({"speed": 0.0}, r"crowd.speed=0.0 m/s: expected > 0"),
        ({"people": 24, "circle": 3.1, "radius": 0.28}, "no room for all of them"),
    ],
)
def test_a_crowd_that_cannot_be_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        CrowdMotion(CrowdParams(**change))


def test_people_of_the_social_force_meet_without_touching_and_arrive():
    people = [Obstacle(-2.0, 0.0, 0.3, 0.0, 0.0), Obstacle(2.0, 0.05, 0.3, 0.0, 0.0)]
    goals, least = [(2.0, 0.0), (-2.0, 0.05)], np.inf
    for _ in range(120):
        moves = social_force_towards(people, goals, 0.6, 0.1)
        people = [
            o._replace(x=o.x + 0.1 * u, y=o.y + 0.1 * v, v_x=u, v_y=v)
            for o, (u, v) in zip(people, moves, strict=True)
        ]
        assert max(hypot(u, v) for u, v in moves) <= 0.78 + 1e-9
        least = min(least, hypot(people[0].x - people[1].x, people[0].y - people[1].y))
    assert least > 0.6
    for person, goal in zip(people, goals, strict=True):
        assert hypot(person.x - goal[0], person.y - goal[1]) < 0.2


@pytest.mark.parametrize("model", ["orca", "social_force"])
def test_who_sees_the_robot_goes_round_it(model):
    gaps = {}
    for sees in (False, True):
        dut = CrowdMotion(CrowdParams(people=6, model=model, sees_robot=sees))
        context = dut.CreateDefaultContext()
        dut.GetInputPort("robot").FixValue(context, [0.0, 0.0, 0.0, 0.0, 0.0])
        simulator = Simulator(dut, context)
        gaps[sees] = np.inf
        for time in np.arange(0.0, 20.0, 0.25):
            simulator.AdvanceTo(time)
            rows = view(OBSTACLES, dut.GetOutputPort("obstacles").Eval(context))
            there = rows.radius > 0.0
            gap = (np.hypot(rows.x, rows.y) - rows.radius - 0.18)[there]
            gaps[sees] = min(gaps[sees], gap.min())
    assert gaps[False] < 0.0 < gaps[True]
