"""Tests of YAML as people write it, and of every bad value's one clear error."""

import codecs
from dataclasses import dataclass, field
import math

import pytest

from diagrams.common.results import results, save_scenario
from diagrams.common.scenario import Scenario, ScenarioError
from diagrams.common.tree import apply_override, fit, make, read_tree, read_yaml
from diagrams.studies import load_scenario


@dataclass
class Part:
    """A nested part."""

    stiffness: float = 1.0
    point: list[float] = field(default_factory=list)
    guess: float | None = None
    on: bool = True
    steps: int = 3
    mode: str = ""
    modes: list[str] = field(default_factory=list)


@dataclass
class Toy(Scenario):
    """A scenario of no system."""

    part: Part = field(default_factory=Part)
    parts: list[Part] = field(default_factory=list)


@dataclass
class Stiff(Scenario):
    """A scenario whose part has a default of its own."""

    part: Part = field(default_factory=lambda: Part(stiffness=7.0, steps=5))


def test_what_is_not_told_of_a_part_is_as_the_scenario_has_it():
    made = make(Stiff, {"part": {"steps": 2}})
    assert (made.part.stiffness, made.part.steps) == (7.0, 2)


def fitted(text: str):
    """A part as a scenario's file would give it."""
    return fit(Toy, {"part": read_yaml(text, "toy")})["part"]


def test_good_data_passes():
    tree = {
        "duration": 3,
        "part": {"stiffness": 1e-3, "point": [1, 2.0], "guess": None, "steps": 2},
        "parts": [{"guess": 0.5}],
    }
    assert fit(Toy, tree) == tree


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"durtion": 3.0}, r"unknown key 'durtion': did you mean 'duration'"),
        ({"part": {"stifness": 1.0}}, r"'part.stifness': did you mean 'stiffness'"),
        ({"part": {"zzz": 1.0}}, r"choose from guess, mode, modes, on, point, steps"),
        ({"part": {1: 1.0}}, r"unknown key 'part.1'"),
        ({"part": {"stiffness": "high"}}, r"part.stiffness='high': expected a number"),
        ({"part": {"stiffness": True}}, r"part.stiffness=True: expected a number"),
        ({"part": {"stiffness": math.nan}}, r"part.stiffness=nan: .* finite"),
        ({"part": {"stiffness": "nan"}}, r"part.stiffness='nan': .* finite"),
        ({"part": {"point": [0.0, math.inf]}}, r"part.point\[1\]=inf: .* finite"),
        ({"part": {"point": 3.0}}, r"part.point=3.0: expected a list"),
        ({"part": {"steps": 1.5}}, r"part.steps=1.5: expected a whole number"),
        ({"part": {"on": 1}}, r"part.on=1: expected true or false"),
        ({"part": {"on": "maybe"}}, r"part.on='maybe': expected true or false"),
        ({"part": 3}, r"part=3: expected keys and values"),
        ({"parts": [{"guess": "x"}]}, r"parts\[0\].guess='x': expected a number"),
        ({"description": 4}, r"description=4: expected a text"),
    ],
)
def test_bad_data_is_named(tree, message):
    with pytest.raises(ScenarioError, match=message):
        fit(Toy, tree)


@pytest.mark.parametrize(
    ("text", "number"),
    [("1e-3", 0.001), ("5e-05", 0.00005), ("-2E3", -2000.0), (".5", 0.5), ("7", 7)],
)
def test_numbers_as_people_write_them(text, number):
    part = fitted(f"{{stiffness: {text}, guess: {text}, point: [{text}, 1e-3]}}")
    assert part == {"stiffness": number, "guess": number, "point": [number, 0.001]}


@pytest.mark.parametrize("word", ["off", "no", "yes", "on", "No", "OFF"])
def test_words_are_texts_where_texts_are_wanted_and_switches_elsewhere(word):
    part = fitted(f"{{mode: {word}, modes: [a, {word}], on: {word}}}")
    assert part["mode"] == word and part["modes"] == ["a", word]
    assert part["on"] is (word in ("yes", "on"))


def test_a_word_that_is_a_key_stays_one():
    assert fitted("{on: true}") == {"on": True}


@pytest.mark.parametrize(
    "text",
    [
        "a: 1\nb: 2\nc:\n  d: 1\n  b: 2\n  d: 3\n",
        "a: 1\nb: 2\nc: &c\n  e: 1\nd:\n  <<: *c\n  d: 2\n  'd': 3\n",
        "a: 1\nb: [{d: 1,\n d: 2}]\n",
    ],
)
def test_a_key_that_stands_twice_is_refused(tmp_path, text):
    path = tmp_path / "twice.yaml"
    path.write_text(text)
    line = text[: text.rindex("d")].count("\n") + 1
    with pytest.raises(
        ScenarioError, match=rf"twice.yaml, line {line}: key 'd' stands"
    ):
        read_tree(path)


def test_a_merged_key_may_be_replaced():
    text = "one: &one {a: 1, b: 2}\ntwo: &two {<<: *one, b: 3}\nthree: {<<: *two, a: 4}"
    assert read_yaml(text, "merge")["three"] == {"a": 4, "b": 3}


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16"], ids=["none", "utf-8", "utf-16"]
)
def test_a_byte_order_mark_is_no_text(tmp_path, encoding):
    path = tmp_path / "marked.yaml"
    path.write_text("system: gauze\ndescription: 5 µm\n", encoding=encoding)
    marks = (codecs.BOM_UTF8, codecs.BOM_UTF16)
    assert path.read_bytes().startswith(marks) == (encoding != "utf-8")
    assert read_tree(path) == {"system": "gauze", "description": "5 µm"}


def test_a_picture_is_no_scenario(tmp_path):
    path = tmp_path / "picture.yaml"
    path.write_bytes(bytes([0xFF, 0xD8, 0xFF, 0xE0]) * 9)
    with pytest.raises(ScenarioError, match=r"cannot read .*picture\.yaml"):
        read_tree(path)


def test_keys_with_an_underscore_are_templates(tmp_path):
    path = tmp_path / "template.yaml"
    path.write_text("_tool: &tool {a: 1}\npart: *tool\n")
    assert read_tree(path) == {"part": {"a": 1}}


def test_overrides_reach_into_the_tree():
    tree = {"part": {"stiffness": 1.0}}
    assert apply_override(tree, "part.stiffness=2.5") == "part"
    apply_override(tree, "part.point=[1, 2]")
    apply_override(tree, "fresh.key=text")
    assert tree == {
        "part": {"stiffness": 2.5, "point": [1, 2]},
        "fresh": {"key": "text"},
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("part", "expected KEY.SUB=VALUE"),
        ("=3", "expected KEY.SUB=VALUE"),
        ("part..x=3", "expected KEY.SUB=VALUE"),
        ("part.stiffness.x=1", "'stiffness' has no keys below it"),
        ("part={on: true, on: false}", "key 'on' stands twice"),
        ("part=[1", "is no value"),
    ],
)
def test_an_override_without_form_is_refused(text, message):
    with pytest.raises(ScenarioError, match=rf"--set .*{message}"):
        apply_override({"part": {"stiffness": 1.0}}, text)


def test_a_scenario_takes_what_people_write_and_keeps_it(tmp_path):
    overrides = ["wrist=off", "compare=[off, known]", "abdomen.stiffness=2e3"]
    scenario = load_scenario("pwe_arc", [*overrides, "description=1e-3"], duration=3)
    with results(tmp_path) as into:
        saved = save_scenario(scenario, into)
    for loaded in (scenario, load_scenario(str(saved))):
        assert loaded.wrist == "off" and loaded.compare == ["off", "known"]
        assert loaded.abdomen.stiffness == 2000.0
        assert loaded.description == "1e-3"


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 30)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "at most 100000 values"),
        ("a: &a [*a]", "at most 100000 values"),
        ("[" * 5000, "nested too deep"),
        (f"a: {'9' * 5000}", "digits"),
        ("? [1, 2]\n: 3", "unhashable"),
    ],
)
def test_yaml_that_grows_is_refused(text, message):
    with pytest.raises(ScenarioError, match=message):
        read_yaml(text, "bomb")


def test_a_file_that_is_no_scenario_by_its_size(tmp_path):
    path = tmp_path / "large.yaml"
    path.write_text("#" * 1_000_001)
    with pytest.raises(ScenarioError, match=r"large\.yaml: 1000001 bytes"):
        read_tree(path)
