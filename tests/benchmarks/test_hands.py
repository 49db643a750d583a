"""The first of the synthetic hands, and a study of two hundred."""

import pytest

from tests.benchmarks.hands import FAST, run_scene


def test_the_first_hands_are_got_away_from():
    results = [run_scene(1, k, FAST) for k in range(6)]
    assert not any(r.outcome.contact for r in results)
    assert sum(r.outcome.time is not None for r in results) >= 5
    assert all(r.outcome.clearance > 0.0009 for r in results)


@pytest.mark.study
def test_of_two_hundred_hands_at_most_one_percent_touch():
    results = [run_scene(41, k, FAST) for k in range(200)]
    assert not any(r.outcome.contact and r.holds for r in results)
    assert sum(r.outcome.contact for r in results) <= 2
