"""The robot passes worlds that it only sees, and what no one can avoid is known."""

from functools import partial
from math import hypot

import pytest

from systems.switching.heading_law import heading_law
from tests.benchmarks.built_scenes import KINDS, built
from tests.benchmarks.dynamic_window import _wanted, dynamic_window
from tests.benchmarks.navigation_loop import control_law, run
from tests.benchmarks.navigation_scenes import Scene, in_hall, steady, three_moving
from tests.benchmarks.navigators import switching
from tests.benchmarks.sensed import Senses
from tests.benchmarks.sensed_step import report
from tests.benchmarks.sensed_suite import avoidable, recorded, tables


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


def test_filmed_people_are_met_clear_of_the_start():
    (scene,) = recorded(1, 1)
    gaps = [hypot(x - scene.start[0], y - scene.start[1])
            for x, y, *_ in scene.frames(0)]  # fmt: skip
    assert min(gaps) > 1.2 and len(scene.frames(300)) == len(gaps) > 3


def test_the_dynamic_window_passes_what_stands_and_what_crosses():
    discs = [(3.0, 0.1, 0.3, 0.0, 0.0), (6.0, -5.0, 0.3, 0.0, 0.4)]
    scene = Scene("two", (0.0, 0.0), (8.0, 0.0), steady(discs, 0.05))
    result = run(scene, partial(dynamic_window, 0.1))
    assert result.outcome == "reached" and result.clearance > 0.05
    # The common control law answers its velocity by the arc that was chosen.
    law = control_law(scene.robot)
    for rate in (-1.8, -0.4, 0.0, 1.2):
        command = heading_law(law, 0.3, *_wanted(scene.robot, 0.3, 0.4, rate), False)
        assert command.turn_rate == pytest.approx(rate, abs=0.01)
        assert command.speed == pytest.approx(0.4)


def test_what_a_scan_costs_is_told_by_part():
    text = report(1, 20)
    assert "place and grid" in text and "all" in text
