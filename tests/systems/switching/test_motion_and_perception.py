"""Obstacles' motion, the crowd, perception, and the control law."""

from math import hypot, nan, pi

import numpy as np
import pytest

from plants.crowd.crowd_motion import CrowdMotion, CrowdParams, starts
from plants.crowd.obstacle_motion import (
    ObstacleMotion,
    ObstacleParams,
    place_and_velocity,
)
from plants.crowd.orca import orca_towards, orca_velocity
from systems.switching.classical_planner import (
    ClassicalParams,
    ClassicalPlanner,
    summed_fields,
)
from systems.switching.perception import PerceptionParams, perceive
from systems.switching.unicycle_control import UnicycleControlParams, heading_law


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
            place = place_and_velocity(o, k * dt)[:2]
            assert place == pytest.approx((x, y), abs=2e-2)
        x, y = x + dt * u, y + dt * v
        u = abs(u) if x < 0.3 else -abs(u) if x > 2.7 else u
        v = abs(v) if y < 0.3 else -abs(v) if y > 1.7 else v


def test_waypoints_and_their_velocity():
    o = ObstacleParams(
        motion="waypoints", times=[1.0, 3.0], points=[[0.0, 0.0], [1.0, 2.0]]
    )
    assert place_and_velocity(o, 0.0) == (0.0, 0.0, 0.0, 0.0)
    assert place_and_velocity(o, 2.0) == (0.5, 1.0, 0.5, 1.0)
    assert place_and_velocity(o, 9.0) == (1.0, 2.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, r"radius=0.0 m must be positive"),
        ({"radius": -1.0}, r"radius=-1.0 m must be positive"),
        ({"start": [nan, 0.0]}, "not finite"),
        ({"start": [1.0]}, "need 2 numbers"),
        ({"motion": "hopping"}, r"motion='hopping' must be one of straight"),
        ({"motion": "waypoints"}, "as many rising times as points"),
        ({"motion": "bouncing", "start": [50.0, 0.0]}, "must lie in its box"),
    ],
)
def test_bad_obstacles_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        ObstacleMotion([ObstacleParams(**change)])


def test_two_who_meet_give_way_to_each_other():
    a, b = (0.0, 0.0, 1.0, 0.0, 0.3), (3.0, 0.1, -1.0, 0.0, 0.3)
    va = orca_velocity(a, [b], (1.0, 0.0), 1.0)
    vb = orca_velocity(b, [a], (-1.0, 0.0), 1.0)
    assert va[1] < 0.0 < vb[1]
    # Together they miss each other for five seconds.
    t = np.linspace(0.0, 5.0, 200)
    gap = np.hypot(3.0 + t * (vb[0] - va[0]), 0.1 + t * (vb[1] - va[1]))
    assert gap.min() > 0.6 - 1e-6


def test_a_crowd_crosses_without_touching():
    params = CrowdParams(people=8, speed=1.0, seed=2)
    people = [(x, y, 0.0, 0.0, 0.3) for x, y in starts(params)]
    goals = [(-x, -y) for x, y, *_ in people]
    least = 9.0
    for _ in range(80):
        moves = orca_towards(people, goals, 1.0)
        people = [
            (x + 0.25 * u, y + 0.25 * v, u, v, r)
            for (x, y, _, _, r), (u, v) in zip(people, moves, strict=True)
        ]
        places = np.array([p[:2] for p in people])
        gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        least = min(least, gaps[~np.eye(8, dtype=bool)].min())
    assert least > 0.6
    assert np.abs(places - goals).max() < 0.3


def test_a_crowd_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"people=100 do not fit on the circle"):
        CrowdMotion(CrowdParams(people=100))


def test_perception_sees_within_its_disc_and_adds_noise():
    params = PerceptionParams(3.0, 0.02, 0.05)
    rows = [2.0, 0.0, 0.3, 0.1, 0.0, 3.1, 0.0, 0.3, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    noise = [1.0, -1.0, 2.0, 0.0] + [0.0] * 8
    seen = perceive(params, [0.0, 0.0], rows, noise)
    assert seen[:6] == pytest.approx([0.0, 2.02, -0.02, 0.3, 0.2, 0.0])
    assert seen[6] == -1.0 and seen[12] == -1.0  # too far; nothing
    with pytest.raises(ValueError, match=r"obstacle 0.* must be finite"):
        perceive(params, [0.0, 0.0], [nan, 0.0, 0.3, 0.0, 0.0], [0.0] * 4)


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


def test_the_sum_vanishes_between_two_obstacles():
    params = ClassicalParams()
    pair = [(0.0, 4.1, 5.0, 0.6, 0.0, 0.0), (1.0, 5.9, 5.0, 0.6, 0.0, 0.0)]
    speeds = [
        summed_fields(params, (5.0, y), (5.0, 10.0), pair)[1]
        for y in np.linspace(3.0, 5.0, 200)
    ]
    assert speeds[0] > 0.49 and min(speeds) < 0.0  # it turns back before the gap
    with pytest.raises(ValueError, match=r"form='sum' must be one of khatib"):
        ClassicalPlanner(ClassicalParams(form="sum"))


def test_both_forms_push_away_and_keep_the_speed():
    seen = [(0.0, 1.2, 0.0, 0.3, 0.0, 0.0)]
    khatib = summed_fields(ClassicalParams(), (0.5, 0.0), (0.5, 9.0), seen)
    printed = summed_fields(
        ClassicalParams(form="printed"), (0.5, 0.0), (0.5, 9.0), seen
    )
    assert khatib[0] < 0.0 and printed[0] < 0.0
    assert hypot(*khatib) <= 0.5 + 1e-9 and hypot(*printed) <= 0.5 + 1e-9
