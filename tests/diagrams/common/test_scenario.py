"""Tests of scenario loading: every bad value gets one clear error."""

from pathlib import Path

import pytest

from diagrams.common.results import files, results, save_scenario
from diagrams.common.scenario import ScenarioError, find_scenario, scenario_files
from diagrams.studies import load_scenario


def test_names_and_files():
    assert find_scenario("gauze_static").is_file()
    with pytest.raises(ScenarioError, match="did you mean 'gauze_static'"):
        find_scenario("gauze_statc")
    with pytest.raises(ScenarioError, match="no scenario file"):
        find_scenario("nowhere/scenario.yaml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("duration: 1.0", "missing key 'system'"),
        ("system: gaze\nduration: 1.0", "did you mean 'gauze'"),
        ("- 1", "holds no keys"),
        ("a: [", "cannot read"),
        ("system: gauze", "missing key 'duration'"),
        ("system: gauze\nseed: 1\nseed: 2", r"broken.yaml, line 3: key 'seed' stands"),
    ],
)
def test_broken_files(tmp_path, text, message):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_scenario(str(path))


@pytest.mark.parametrize("name", list(scenario_files()))
def test_every_scenario_loads_and_survives_saving(name, tmp_path: Path):
    scenario = load_scenario(name, seed=5)
    assert scenario.description
    assert scenario.seed == 5
    with results(tmp_path) as into:
        saved = save_scenario(scenario, into)
    again = load_scenario(str(saved))
    for one in (scenario, again):  # a file that is named lies beside it now
        for owner, field in files(one):
            setattr(owner, field, Path(getattr(owner, field)).name)
    assert again == scenario


def test_duration_and_seed_are_checked():
    with pytest.raises(ScenarioError, match="duration=-1"):
        load_scenario("gauze_static", duration=-1.0)
    with pytest.raises(ScenarioError, match="seed=-1"):
        load_scenario("gauze_static", seed=-1)
