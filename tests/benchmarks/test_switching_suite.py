"""The benchmark runs, and its worlds are what they say."""

from math import hypot

import pytest

from tests.benchmarks.navigation_scenes import SUITES, solvable
from tests.benchmarks.navigators import switching
from tests.benchmarks.switching_suite import evaluate, report


@pytest.mark.parametrize("name", [n for n in SUITES if n != "crowd 20"])
def test_a_few_scenes_of_every_suite_are_passed(name):
    results = evaluate(SUITES[name](0, 6), switching)
    assert [r.outcome for r in results] == ["reached"] * 6


def test_scenes_depend_on_the_seed_alone():
    one, two, other = (SUITES["three moving"](seed, 1)[0] for seed in (0, 0, 5))
    assert one.frames(40) == two.frames(40) != other.frames(40)


def test_solvable():
    wall = [(2.0, 0.5 * k, 0.2) for k in range(-8, 9)]
    assert solvable(wall, (0.0, 0.0), (4.0, 0.0), 0.3)  # round its ends
    ring = [(4.0 + a, b, 0.4) for a in (-0.8, 0, 0.8) for b in (-0.8, 0, 0.8) if a or b]
    assert not solvable(ring, (0.0, 0.0), (4.0, 0.0), 0.3)


def test_crowds_start_as_crowdnav_draws_them():
    scene = SUITES["crowd 5"](0, 1)[0]
    places = [(x, y) for x, y, *_ in scene.frames(0)]
    assert len(places) == 5
    assert all(3.2 < hypot(x, y) < 4.8 for x, y in places)


def test_report():
    assert "held-out seed 3" in report(3, 1, ["one crossing"])
