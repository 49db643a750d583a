"""The random scenes among organs."""

import numpy as np
import pytest

from systems.bypass.organ_route import organ_room
from systems.common.geometry import along, sub
from tests.benchmarks.organ_suite import KINDS, G, bank, exact_gap, is_clear, run, scene


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_shut_straight_and_its_ends_are_free(kind):
    one = scene(kind, 3, 0)
    assert is_clear(one, one.start, 0.0)
    assert is_clear(one, one.goal, 0.0)
    way = [along(one.start, t / 20, sub(one.goal, one.start)) for t in range(21)]
    assert min(organ_room(one.organs(0.0), 0.0, G, p)[0] for p in way) < 0.0
    assert scene(kind, 3, 0).start == one.start


def test_the_bypass_arrives_and_keeps_clear():
    outcome = run(scene("breathing", 3, 1), True)
    assert outcome.reached
    assert outcome.clearance > 0.001
    assert outcome.tool_clearance > 0.001


def test_the_exact_gap_is_that_of_the_triangles():
    surface, _ = bank()[0]
    top = surface.points[surface.points[:, 2].argmax()]
    off = np.array([0.0, 0.0, -0.1]) - top
    gap = exact_gap(*surface, off, np.array([0.0, 0.0, -0.09]))
    assert gap == pytest.approx(0.01, abs=1e-3)


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_scenes(kind):
    outcomes = [run(scene(kind, 11, number), True) for number in range(1000)]
    assert sum(o.reached for o in outcomes) >= 990
    assert min(min(o.clearance, o.tool_clearance) for o in outcomes) > 0.0
