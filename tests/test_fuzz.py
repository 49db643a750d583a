"""Mutated scenarios are run-able or refused; no number is without bounds."""

import pytest

from diagrams.common.scenario import scenario_files
from diagrams.studies import load_scenario
from systems.common.parameter import keys
from tests.fuzz import ABSURD, fuzz


def test_mutated_scenarios_are_run_able_or_refused(tmp_path):
    found = fuzz(500, 12, tmp_path)
    assert found.refused + found.accepted == 500, str(found)
    assert not found.escaped, str(found)
    assert not found.absurd, str(found)
    assert found.accepted > 25


@pytest.mark.study
def test_very_many_mutated_scenarios(tmp_path):
    found = fuzz(20_000, 0, tmp_path)
    assert not (found.escaped or found.absurd), str(found)


@pytest.mark.parametrize("name", list(scenario_files()))
def test_no_number_is_without_bounds(name):
    checked = 0
    for key in keys(load_scenario(name)):
        told, value = key.parameter, key.value
        if isinstance(value, float):
            assert not any(map(told.holds, ABSURD)), key.name
            checked += 1
        elif isinstance(value, list) and value and isinstance(value[0], float):
            for absurd in ABSURD:
                assert not told.holds([absurd, *value[1:]]), key.name
            checked += 1
    assert checked > 10
