"""`trocar keys` tells every key of a scenario: default, unit, bounds, meaning."""

import dataclasses
import json

import pytest

from diagrams.common.cli import main
from diagrams.common.keys import as_json, as_text, matching
from diagrams.common.scenario import ScenarioError
from diagrams.studies import STUDIES, load_scenario
from systems.common.parameter import keys

NAMES = {
    "keyhole": "keyhole_circle",
    "gauze": "gauze_breathing",
    "wrist": "pwe_arc",
    "navigation": "nav_three_moving",
    "snake": "snake_circle",
    "resection": "resect_paper",
}


def undeclared(params, owner=""):
    """Fields that are neither a parameter nor a part with parameters of its own."""
    for field in dataclasses.fields(params):
        value, key = getattr(params, field.name), f"{owner}.{field.name}"
        parts = value if isinstance(value, list) else [value]
        inner = [part for part in parts if dataclasses.is_dataclass(part)]
        for part in inner:
            yield from undeclared(part, key)
        if not inner and "parameter" not in field.metadata:
            yield key


def test_every_system_has_a_name_here():
    assert set(NAMES) == set(STUDIES)


@pytest.mark.parametrize("name", NAMES.values())
def test_every_key_is_declared_with_bounds_and_meaning(name):
    scenario = load_scenario(name)
    assert not [*undeclared(scenario)]
    found = [*keys(scenario)]
    assert len({key.name for key in found}) == len(found) > 20
    for key in found:
        assert key.parameter.meaning
        numbers = isinstance(key.value, float | int) and not isinstance(key.value, bool)
        if numbers:
            told = key.parameter
            assert max(told.above, told.least) > -1e300 and told.most < 1e300, key.name


def test_a_pattern_narrows_and_a_misspelt_one_is_told():
    scenario = load_scenario("gauze_static")
    assert [key.name for key in matching(scenario, "fuzzy_arbiter.per*")] == [
        "fuzzy_arbiter.period"
    ]
    assert "obstacle.points" in [key.name for key in matching(scenario, "points")]
    with pytest.raises(ScenarioError, match=r"fuzzy_arbiter.priod.*fuzzy_arbiter.peri"):
        matching(scenario, "fuzzy_arbiter.priod")


def test_text_and_json_say_the_same(capsys):
    found = matching(load_scenario("gauze_breathing"), "fuzzy_arbiter.period")
    line = as_text(found)
    assert "0.0333333 s (default 0.0166667)" in line and "> 0" in line
    (told,) = json.loads(as_json(found))
    assert told["value"] == pytest.approx(1 / 30) and told["unit"] == "s"
    assert told["above"] == 0.0 and told["default"] == pytest.approx(1 / 60)
    assert main(["keys", "gauze_static", "abdomen", "--json"]) == 0
    assert any(
        "abdomen.stiffness" in d["key"] for d in json.loads(capsys.readouterr().out)
    )
    assert main(["keys", "gauze_static", "abdomn.stifness"]) == 2
    assert "abdomen.stiffness" in capsys.readouterr().err
