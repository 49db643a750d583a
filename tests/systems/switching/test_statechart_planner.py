"""The geometry of the thesis's two-helicoid bypass."""

from math import hypot

import numpy as np
import pytest

from systems.switching.fields import helicoid_field
from systems.switching.signals import Seen
from systems.switching.statechart_planner import (
    Manoeuvre,
    StatechartParams,
    StatechartPlanner,
    bypass,
    in_tube,
    statechart_step,
)


def random_cases(count):
    rng = np.random.default_rng(2)
    while count:
        p, goal = (0.0, 0.0), (rng.uniform(4.0, 9.0), 0.0)
        rho = rng.uniform(0.4, 1.0)
        x, y = rng.uniform(1.2, 3.0), rng.uniform(-1, 1) * rho
        obstacle = Seen(1.0, x, y, 0.1, 0.0, 0.0)
        if goal[0] - x > rho + 0.1:
            count -= 1
            yield p, goal, obstacle, rho


def test_circles_are_tangent_and_the_heading_never_jumps():
    for p, goal, obstacle, rho in random_cases(200):
        m = bypass(p, goal, obstacle, rho, 0.5)
        o = np.array([obstacle.x, obstacle.y])
        omega = np.array([m.omega_x, m.omega_y])
        a = np.linalg.norm(omega - p)
        assert np.linalg.norm(omega - o) == pytest.approx(a + rho)
        # At the entry the motion about Omega points to the goal, at full speed.
        assert helicoid_field(*(p - omega), m.c_omega) == pytest.approx((0.5, 0.0))
        # At P1 both circles have one velocity.
        p1 = np.array([m.p1_x, m.p1_y])
        about_omega = helicoid_field(*(p1 - omega), m.c_omega)
        assert helicoid_field(*(p1 - o), m.c_o) == pytest.approx(about_omega)
        # At P2 it points at the goal.
        p2 = np.array([m.p2_x, m.p2_y])
        u, v = helicoid_field(*(p2 - o), m.c_o)
        way = np.array(goal) - p2
        assert u * way[1] - v * way[0] == pytest.approx(0.0, abs=1e-9)
        assert u * way[0] + v * way[1] > 0.0


def test_only_what_stands_in_the_tube_counts():
    before = Seen(0.0, 3.0, 0.1, 0.3, 0.0, 0.0)
    behind = Seen(1.0, 9.5, 0.0, 0.3, 0.0, 0.0)
    beside = Seen(2.0, 3.0, 1.0, 0.3, 0.0, 0.0)
    assert in_tube((0.0, 0.0), (9.0, 0.0), [behind, beside], 0.3) is None
    assert in_tube((0.0, 0.0), (9.0, 0.0), [behind, before], 0.3) is before


@pytest.mark.parametrize("offset", [-0.3, 0.0, 0.3])
def test_a_point_passes_an_obstacle_at_its_safety_circle(offset):
    params = StatechartParams()
    state, place = Manoeuvre(), (0.0, 0.0)
    seen = [Seen(0.0, 4.0, offset, 0.5, 0.0, 0.0)]
    least, states = 9.0, []
    for _ in range(2500):
        vx, vy, state = statechart_step(params, state, place, (8.0, 0.0), seen)
        place = (place[0] + 0.01 * vx, place[1] + 0.01 * vy)
        least = min(least, hypot(place[0] - 4.0, place[1] - offset))
        states.append(int(state.state))
    assert hypot(place[0] - 8.0, place[1]) < 0.02
    assert least == pytest.approx(0.5 + 0.18 + 0.15, abs=0.02)
    assert list(dict.fromkeys(states)) == [1, 2, 0]


def test_bad_parameters_are_refused():
    with pytest.raises(ValueError, match=r"statechart.margin=-0.1 m: expected >= 0.02"):
        StatechartPlanner(StatechartParams(margin=-0.1))
