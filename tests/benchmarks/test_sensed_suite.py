"""The robot passes worlds that it only sees, and what no one can avoid is known."""

import pytest

from tests.benchmarks.built_scenes import KINDS, built
from tests.benchmarks.navigation_loop import run
from tests.benchmarks.navigation_scenes import Scene, in_hall, steady, three_moving
from tests.benchmarks.navigators import switching
from tests.benchmarks.sensed import Senses
from tests.benchmarks.sensed_suite import avoidable, tables


@pytest.mark.parametrize("scene", built(3, 4), ids=list(KINDS))
def test_worlds_of_walls_are_passed(scene):
    result = run(scene, switching, Senses(), 1)
    assert result.outcome == "reached" and result.astray < 0.2


def test_moving_obstacles_are_passed_in_a_hall():
    for k, scene in enumerate(three_moving(3, 2)):
        result = run(in_hall(scene), switching, Senses(), k)
        assert result.outcome == "reached" and result.astray < 0.15


def test_what_can_be_avoided():
    def ring(radius: float) -> Scene:
        """Obstacles on all sides, that close in at the robot's speed and more."""
        discs = []
        around = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
        for x, y in around:
            size = (x * x + y * y) ** 0.5
            u, v = x / size, y / size
            discs.append((1.5 * u, 1.5 * v, radius, -0.8 * u, -0.8 * v))
        return Scene("ring", (0.0, 0.0), (8.0, 0.0), steady(discs, 0.05))

    assert not avoidable(ring(0.5), 5.0) and avoidable(ring(0.1), 5.0)


def test_report():
    (table,) = tables(1, 1, ["streams"], ["switching"])
    assert "streams: 1 of 1" in table and "switching" in table
