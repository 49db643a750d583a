"""Blocked headings, held against stepping through time."""

from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest

from systems.switching.arcs import (
    ARC_SIZE,
    Disc,
    blocked_arcs,
    nearest_free,
    time_to_enter,
)
from systems.switching.fields import involute_field

RNG = np.random.default_rng(4)


def worlds(count, fastest):
    for _ in range(count):
        d, angle = RNG.uniform(0.9, 4.0), RNG.uniform(-pi, pi)
        w, direction = RNG.uniform(0.0, fastest), RNG.uniform(-pi, pi)
        x, y = d * cos(angle), d * sin(angle)
        yield Disc(0.0, -x, -y, 0.4, w * cos(direction), w * sin(direction))


def within(arcs, heading):
    return any((heading - first) % (2.0 * pi) < width for first, width, *_ in arcs)


@pytest.mark.parametrize("fastest", [0.0, 0.45, 1.2])
def test_a_heading_is_blocked_exactly_if_it_enters_the_circle(fastest):
    for obstacle in worlds(60, fastest):
        arcs = blocked_arcs(0.5, np.array([obstacle]), 0.3, 1e6)
        for heading in np.linspace(-pi, pi, 41):
            vx, vy = 0.5 * cos(heading), 0.5 * sin(heading)
            time = time_to_enter(vx, vy, np.array([obstacle]), 0.3)
            # A hair's breadth beside an edge either answer is right.
            near = [
                time_to_enter(vx, vy, np.array([obstacle]), 0.3 + e)
                for e in (-0.01, 0.01)
            ]
            if all(np.isfinite(t) == np.isfinite(time) for t in near):
                assert within(arcs, heading) == np.isfinite(time)


def test_time_to_enter_is_when_the_circle_is_met():
    for obstacle in worlds(50, 0.6):
        t = time_to_enter(0.5, 0.0, np.array([obstacle]), 0.2)
        if np.isfinite(t):
            x = obstacle.q_x + t * (0.5 - obstacle.w_x)
            y = obstacle.q_y - t * obstacle.w_y
            assert hypot(x, y) == pytest.approx(0.6)


def test_arcs_end_at_the_involute_fields_of_both_sides():
    for obstacle in worlds(40, 0.4):
        ((first, width, *_),) = blocked_arcs(0.5, np.array([obstacle]), 0.3, 1e6)
        for heading, side in ((first, 1.0), (first + width, -1.0)):
            ux = 0.5 * cos(heading) - obstacle.w_x
            uy = 0.5 * sin(heading) - obstacle.w_y
            ex, ey = involute_field(obstacle.q_x, obstacle.q_y, 0.7, side)
            assert (ux, uy) == pytest.approx((hypot(ux, uy) * ex, hypot(ux, uy) * ey))


def test_equal_speeds_are_no_hole():
    # An obstacle that drives beside the body at its own speed: turning into it is
    # blocked, keeping beside it is not.
    beside = Disc(0.0, -0.75, -0.41, 0.3, -0.46, 0.89)
    speed = hypot(-0.46, 0.89)
    arcs = blocked_arcs(speed, np.array([beside]), 0.5, 8.0)
    assert within(arcs, 1.2)
    assert not within(arcs, 2.4)


def test_nearest_free_turns_least_and_remembers_its_side():
    obstacle = Disc(7.0, -2.0, -0.1, 0.3, 0.0, 0.0)
    arcs = blocked_arcs(0.5, np.array([obstacle]), 0.3, 1e6)
    choice = nearest_free(arcs, 0.0, 0.5, 0.35, 0.3, -1.0, 1.0, 0.0, 0.0)
    # It stands to the left: to the right.
    assert choice.heading < 0.0 and choice.side == 1.0
    kept = nearest_free(arcs, 0.0, 0.5, 0.35, 0.3, 7.0, -1.0, 0.0, 0.0)
    assert kept.heading > 0.0 and kept.side == -1.0
    nobody, rest = np.empty((0, ARC_SIZE)), (0.0, 0.0, -1.0, 1.0, 0.0, 0.0)
    assert nearest_free(nobody, 0.3, 0.5, *rest).heading == 0.3
    blind = np.array([[0.0, 2.0 * pi, 7.0, 0.0, 0.0]])
    assert nearest_free(blind, 0.3, 0.5, *rest).turn == inf
