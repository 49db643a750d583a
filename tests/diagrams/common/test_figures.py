"""Figures in people's words, and that every figure is declared."""

import json
from pathlib import Path

import pytest

from diagrams.common.figures import FIGURES, in_words, table

GOLDEN = Path(__file__).parents[2] / "golden.json"


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("min_tool_clearance", 0.007589, "7.59 mm"),
        ("min_target_clearance", -0.0032, "-3.2 mm"),
        ("path_length", 18.22, "18.2 m"),
        ("final_tip_error", 1.5e-5, "15 um"),
        ("execution_time", 1001.5, "16.7 min"),
        ("planner_step_median", 0.000141, "141 us"),
        ("resected_fraction", 0.9534, "95.3 %"),
        ("tumour_volume", 8.6765e-06, "8.68 cm3"),
        ("healthy_removed", 1.875e-09, "1.87 mm3"),
        ("max_lateral_force", 0.2084, "0.2084 N"),
        ("body_collisions", 0, "0"),
        ("reached", True, "yes"),
        ("time_ratio", None, "-"),
        ("stops", [], "none"),
        (
            "stops",
            [{"reason": "lost", "start": 1.5, "duration": 0.25}],
            "reason lost, start 1.5 s, duration 250 ms",
        ),
    ],
)
def test_words(key, value, words):
    assert in_words(key, value) == words


def test_every_figure_of_every_scenario_is_declared():
    rows = json.loads(GOLDEN.read_text()).values()
    known = {key for row in rows if isinstance(row, dict) for key in row}
    assert known - FIGURES.keys() == set()


def test_every_figure_says_what_it_is():
    assert all(figure.meaning for figure in FIGURES.values())
    lines = table({"reached": True, "stops": [{"start": 1.0}, {"start": 2.0}]})
    assert lines.splitlines()[2].split() == ["start", "2", "s"]
