"""The switching planner: its rules, its limits, its speed."""

from math import dist, hypot, inf, nan
import statistics
import subprocess
import sys
from time import perf_counter

import numpy as np
import pytest

from systems.switching.evasion import Body
from systems.switching.signals import Corner, Seen
from systems.switching.switching_planner import SwitchingPlanner
from systems.switching.switching_rules import LAW, plan, planned, rows
from systems.switching.switching_state import (
    ATTRACTIVE,
    BYPASS,
    GROUP,
    UNREACHABLE,
    SwitchingParams,
    SwitchingState,
    constants,
)

PARAMS = SwitchingParams(response=0.0)


def step(obstacles, place=(0.0, 0.0), state=None, goal=(8.0, 0.0), params=PARAMS):
    """One step of a body at rest."""
    state = state or SwitchingState()
    return plan(params, state, place, (0.0, 0.0), goal, obstacles)


def walk(discs, duration=60.0, goal=(8.0, 0.0), vision=3.0):
    """A body without inertia walks; modes and least clearance."""
    place, state, modes, least = (0.0, 0.0), SwitchingState(), [], inf
    for k in range(int(duration / 0.05)):
        t = 0.05 * k
        now = [
            Seen(float(i), x + t * u, y + t * v, r, u, v)
            for i, (x, y, r, u, v) in enumerate(discs)
        ]
        seen = [o for o in now if dist((o.x, o.y), place) <= vision]
        vx, vy, state, *_ = step(seen, place, state, goal)
        place = (place[0] + 0.05 * vx, place[1] + 0.05 * vy)
        modes.append(int(state.mode))
        gaps = [dist((o.x, o.y), place) - o.radius - 0.18 for o in now]
        least = min([least, *gaps])
        if hypot(place[0] - goal[0], place[1] - goal[1]) < 0.1:
            break
    return place, modes, least


def test_alone_it_goes_straight_and_slows_down_at_the_goal():
    assert step([])[:2] == (0.5, 0.0)
    assert step([], goal=(0.1, 0.0))[:2] == pytest.approx((0.2, 0.0))
    assert step([], goal=(0.0, 0.0))[:2] == (0.0, 0.0)


def test_what_does_not_stand_in_the_way_does_not_matter():
    behind_goal = Seen(0.0, 8.8, 0.0, 0.4, 0.0, 0.0)
    beside = Seen(1.0, 2.0, 1.2, 0.4, 0.0, 0.0)
    passing = Seen(2.0, 2.0, 1.5, 0.4, 0.0, 0.5)
    assert step([behind_goal, beside, passing]).state.mode == ATTRACTIVE


def test_the_field_followed_is_one_obstacles_tangent():
    result = step([Seen(5.0, 2.0, 0.1, 0.4, 0.0, 0.0)])
    assert (result.state.mode, result.state.track, result.state.side) == (BYPASS, 5, 1)
    rho = 0.4 + 0.18 + 0.2
    # Distance of the centre from the ray: the safety circle's radius.
    assert (result.v_x * 0.1 - result.v_y * 2.0) / 0.5 == pytest.approx(rho)
    assert hypot(result.v_x, result.v_y) == pytest.approx(0.5)


def test_a_crosser_is_passed_behind():
    result = step([Seen(0.0, 2.0, -2.0, 0.3, 0.0, 0.5 * 0.9)])
    assert result.state.mode == BYPASS and result.v_y < 0.0


@pytest.mark.parametrize("w", [0.0, 0.2, 0.45])
def test_margins_are_kept(w):
    place, _, least = walk([(4.0, -4.0 * w / 0.5, 0.4, 0.0, w)])
    assert hypot(place[0] - 8.0, place[1]) < 0.1
    assert least > 0.17  # 0.2, less what a step of 50 ms loses


def test_a_trap_is_left_round_its_group():
    line = [(4.0, y, 0.3, 0.0, 0.0) for y in np.arange(-1.5, 1.6, 0.5)]
    walls = [(x, y, 0.3, 0.0, 0.0) for x in (2.5, 3.0, 3.5) for y in (-1.5, 1.5)]
    place, modes, least = walk([*line, *walls])
    assert GROUP in modes
    assert hypot(place[0] - 8.0, place[1]) < 0.1
    assert least > 0.05


def test_a_goal_walled_in_is_given_up():
    ring = [
        (8.0 + 1.2 * np.cos(a), 1.2 * np.sin(a), 0.3, 0.0, 0.0)
        for a in np.linspace(0.0, 2.0 * np.pi, 16)[:-1]
    ]
    place, modes, least = walk(ring, 120.0)
    assert modes[-1] == UNREACHABLE
    assert hypot(place[0] - 8.0, place[1]) > 1.2
    assert least > 0.05


def wall(y, x=0.0, half=3.0):
    """Points of a wall along x."""
    places = np.arange(x - half, x + half, 0.1)
    return [Seen(1000.0 + k, a, y, 0.02, 0.0, 0.0) for k, a in enumerate(places)]


def test_who_comes_along_a_corridor_is_passed_by_a_smaller_margin_not_fled_from():
    walls = [
        o._replace(track=o.track + 500.0 * (y > 0.0))
        for y in (-0.9, 0.9)
        for o in wall(y)
    ]
    walker = Seen(1.0, 1.6, 0.2, 0.25, -0.4, 0.0)
    vx, vy, *_ = step([*walls, walker], place=(0.0, -0.3))
    assert vx > 0.4 and vy <= 0.0


def test_who_walks_at_a_wall_is_given_room_to_turn():
    walker = Seen(1.0, 0.75, 0.0, 0.25, 0.0, 0.4)
    free = step([walker], goal=(8.0, -1.0))
    near = step([walker, *wall(1.5, 0.75)], goal=(8.0, -1.0))
    assert hypot(*free[:2]) == pytest.approx(0.5)
    # He turns to the robot: after T = 0.4 s they near each other at s, less by 1 m/s^2.
    s = 0.4 + near.v_x
    assert 0.0 < hypot(*near[:2]) < 0.45
    assert s * 0.4 + 0.5 * s * s <= 0.75 - 0.25 - 0.18 + 1e-9


def test_nobody_unseen_is_waited_for_where_somebody_seen_comes():
    goal, corner = (8.0, 0.0), Corner(1.0, 0.5, 0.3)
    follower = Seen(1.0, -0.9, 0.0, 0.25, 0.45, 0.0)
    rest = (PARAMS, SwitchingState(), (0.0, 0.0), (0.0, 0.0), goal)
    slow, fast = plan(*rest, [], [corner]), plan(*rest, [follower], [corner])
    v = hypot(*slow[:2])  # it stands within the least margin
    assert v < 0.3 and v * 0.2 + 0.5 * v * v == pytest.approx(0.1)
    assert hypot(*fast[:2]) == pytest.approx(0.5)


def test_who_may_turn_is_not_waited_for_where_another_comes():
    walker = Seen(1.0, 0.75, 0.0, 0.25, 0.0, 0.4)
    follower = Seen(2.0, -0.9, 0.0, 0.25, 0.45, 0.0)
    seen = [walker, *wall(1.5, 0.75)]
    slow, fast = step(seen, goal=(8.0, -1.0)), step([*seen, follower], goal=(8.0, -1.0))
    assert hypot(*slow[:2]) < 0.45 and hypot(*fast[:2]) == pytest.approx(0.5)


def test_a_group_is_followed_on_if_the_point_followed_is_lost():
    state = SwitchingState(GROUP, 1010.0, 1.0, 5.0, laps=1.0)
    points = [o for o in wall(0.33) if o.track != 1010.0]
    on = step(points, state=state, goal=(0.0, 4.0)).state
    assert on.mode == GROUP and on.laps == 1.0
    assert step([], state=state, goal=(0.0, 4.0)).state.mode == ATTRACTIVE


def test_a_faster_obstacle_is_told():
    fast = Seen(0.0, 3.0, 0.0, 0.3, -0.8, 0.0)
    result = step([fast])
    assert result.outrun and hypot(result.v_x, result.v_y) > 0.0
    assert not step([Seen(0.0, 3.0, 0.0, 0.3, -0.4, 0.0)]).outrun


def test_within_a_safety_circle_it_leads_out():
    result = step([Seen(0.0, 0.4, 0.0, 0.2, 0.0, 0.0)])
    assert result.v_x < 0.01


def test_the_rules_need_no_drake():
    code = (
        "import sys, systems.switching.switching_rules; "
        "sys.exit(any(name.startswith('pydrake') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_plain_tuples_will_do():
    crosser = (0.0, 2.0, -2.0, 0.3, 0.0, 0.45)
    assert step([crosser]) == step([Seen(*crosser)])


def test_numbers_that_are_none_are_refused():
    with pytest.raises(ValueError, match="not finite"):
        step([Seen(0.0, nan, 0.0, 0.3, 0.0, 0.0)])
    with pytest.raises(ValueError, match="not finite"):
        step([], place=(nan, 0.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body_radius": 0.0}, r"switching.body_radius=0.0 m: expected >= 0.05"),
        ({"speed": -1.0}, r"switching.speed=-1.0 m/s: expected > 0"),
        ({"margins": [0.1, 0.2]}, r"margins=\[0.1, 0.2\] m: expected falling: \[0.2"),
        ({"margins": []}, r"margins=\[\] m: expected at least one"),
        ({"slower": [1.5]}, r"slower=\[1.5\]: expected .* <= 0.95"),
        ({"vision": 0.3}, r"vision=0.3 m: expected > 0.38, body_radius"),
        ({"hysteresis": nan}, r"hysteresis=nan rad: expected >= 0"),
    ],
)
def test_bad_parameters_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        SwitchingPlanner(SwitchingParams(**change))


@pytest.mark.parametrize(("count", "limit"), [(5, 20e-6), (20, 120e-6)])
def test_speed(count, limit):
    # Medians over scattered worlds; four times the limit, for a busy machine.
    rng, record = np.random.default_rng(7), constants(PARAMS)[0]
    rest = LAW, SwitchingState(), (0.0, 0.0), (0.0, 0.0), (8.0, 0.0)
    walls = []
    for _ in range(200):
        places = rng.uniform(-3.0, 3.0, (count, 2))
        places += np.sign(places)
        w = rng.uniform(-0.3, 0.3, (count, 2))
        seen = [
            Seen(float(k), *places[k].tolist(), 0.3, *w[k].tolist())
            for k in range(count)
        ]
        told = rows(seen, [])
        start = perf_counter()
        planned(record, *rest, *told, Body(0.0, 0.0, 0.0))
        walls.append(perf_counter() - start)
    assert statistics.median(walls) < 4.0 * limit
