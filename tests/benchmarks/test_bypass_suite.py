"""The bypass arrives in random scenes, and the sum of potentials stalls in some."""

import pytest

from tests.benchmarks.bypass_suite import FIRST, run_scene


@pytest.mark.parametrize("kind", FIRST)
def test_random_scenes_are_reached_without_contact(kind):
    for number in range(12):
        result = run_scene(kind, "bypass", 21, number)
        assert result.outcome.reached, number
        assert result.outcome.clearance > (0.002 if kind == "standing" else 0.0005)


def test_the_sum_of_potentials_stalls_where_the_bypass_arrives():
    stalled = [
        number
        for number in range(10)
        if not run_scene("standing", "field + constraint", 21, number).outcome.reached
    ]
    assert len(stalled) >= 3
