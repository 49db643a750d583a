"""Tests of scenario loading: every bad value gets one clear error."""

from dataclasses import dataclass, field
import math
from pathlib import Path

import pytest

from diagrams.common.scenario import (
    Scenario,
    ScenarioError,
    apply_override,
    check_tree,
    find_scenario,
    load_scenario,
    save_scenario,
    scenario_files,
)


@dataclass
class Part:
    """A nested part."""

    stiffness: float = 1.0
    point: list[float] = field(default_factory=list)
    guess: float | None = None
    on: bool = True
    steps: int = 3


@dataclass
class Toy(Scenario):
    """A scenario of no system."""

    part: Part = field(default_factory=Part)
    parts: list[Part] = field(default_factory=list)


def test_good_data_passes():
    check_tree(
        Toy,
        {
            "duration": 3,
            "part": {"stiffness": 1e-3, "point": [1, 2.0], "guess": None, "steps": 2},
            "parts": [{"guess": 0.5}],
        },
    )


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"durtion": 3.0}, r"unknown key 'durtion': did you mean 'duration'"),
        ({"part": {"stifness": 1.0}}, r"'part.stifness': did you mean 'stiffness'"),
        ({"part": {"zzz": 1.0}}, r"choose from guess, on, point, steps, stiffness"),
        ({"part": {"stiffness": "high"}}, r"part.stiffness='high': expected a number"),
        ({"part": {"stiffness": True}}, r"part.stiffness=True: expected a number"),
        ({"part": {"stiffness": math.nan}}, r"part.stiffness=nan: .* finite"),
        ({"part": {"point": [0.0, math.inf]}}, r"part.point\[1\]=inf: .* finite"),
        ({"part": {"point": 3.0}}, r"part.point=3.0: expected a list"),
        ({"part": {"steps": 1.5}}, r"part.steps=1.5: expected a whole number"),
        ({"part": {"on": 1}}, r"part.on=1: expected true or false"),
        ({"part": 3}, r"part=3: expected keys and values"),
        ({"parts": [{"guess": "x"}]}, r"parts\[0\].guess='x': expected a number"),
        ({"description": 4}, r"description=4: expected a text"),
    ],
)
def test_bad_data_is_named(tree, message):
    with pytest.raises(ScenarioError, match=message):
        check_tree(Toy, tree)


def test_overrides_reach_into_the_tree():
    tree = {"part": {"stiffness": 1.0}}
    assert apply_override(tree, "part.stiffness=2.5") == "part"
    apply_override(tree, "part.point=[1, 2]")
    apply_override(tree, "fresh.key=text")
    assert tree == {
        "part": {"stiffness": 2.5, "point": [1, 2]},
        "fresh": {"key": "text"},
    }


@pytest.mark.parametrize("text", ["part", "=3", "part..x=3", "part.stiffness.x=1"])
def test_an_override_without_form_is_refused(text):
    with pytest.raises(ScenarioError, match="--set"):
        apply_override({"part": {"stiffness": 1.0}}, text)


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
    saved = save_scenario(scenario, tmp_path)
    again = load_scenario(str(saved))
    for key, value in vars(scenario).items():
        if "recording" not in key:
            assert getattr(again, key) == value


def test_duration_and_seed_are_checked():
    with pytest.raises(ScenarioError, match="duration=-1"):
        load_scenario("gauze_static", duration=-1.0)
    with pytest.raises(ScenarioError, match="seed=-1"):
        load_scenario("gauze_static", seed=-1)
