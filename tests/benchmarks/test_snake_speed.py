"""The snake's speeds, each against its target; a quiet machine is assumed."""

import pytest

from diagrams.common.run import simulate
from diagrams.studies import load_scenario
from tests.benchmarks.snake_speed import circle, drake, kinematics


@pytest.mark.study
def test_kinematics_is_fast_enough():
    for name, figure, target, unit in kinematics(seed=1):
        fast = figure <= target if unit == "us" else figure >= target
        assert fast, f"{name}: {figure:.0f} {unit}, target {target:.0f}"


@pytest.mark.study
def test_circle_runs_thirty_times_faster_than_real_time():
    scenario = load_scenario("snake_circle", duration=4.0)
    factors = [simulate(scenario).metrics["real_time_factor"] for _ in range(3)]
    assert max(factors) >= 30.0


def test_plant_alone_follows_the_circle():
    result = drake(circle(), 0.02)
    assert result.usable
    assert result.tip_error < 0.1e-3
