"""What counts as a failure is parsed, never evaluated as Python."""

import pytest

from diagrams.campaigns.expression import Expression, failures
from diagrams.common.scenario import ScenarioError

FIGURES = {"a": 1.5, "b": -2.0, "yes": True, "kind": "moving", "none": None, "l": [1]}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a > 1", True),
        ("not yes or b < -3", False),
        ("1 < a <= 1.5 and abs(b) == 2", True),
        ("kind == 'moving'", True),
        ("none == none", True),
        ("len(l) > 1", False),
        ("a - b * 2 > 5", True),
        ("missing != 3", True),
        ("yes == true", True),
    ],
)
def test_values(text, value):
    assert bool(Expression(text)(FIGURES)) is value


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "a.__class__",
        "[x for x in l]",
        "lambda: 1",
        "a if yes else b",
        "open('x')",
        "l[0]",
        "a >",
        "f'{a}'",
        "abs(a, b)",
        "",
        "(" * 400 + "a" + ")" * 400,
        "2 ** 2 ** 99",
    ],
)
def test_all_else_is_refused(text):
    with pytest.raises(ScenarioError, match="fail="):
        Expression(text)


def test_failures_are_named_and_what_cannot_be_told_is_one():
    some = [Expression("a > 1"), Expression("b > 0"), Expression("missing > 0")]
    assert failures(some, FIGURES) == ["a > 1", "missing > 0: missing missing"]
    assert failures([], {"error": "it broke"}) == ["error"]


def test_unknown_figures_are_refused_with_the_nearest():
    with pytest.raises(ScenarioError, match="did you mean 'clearance'"):
        Expression("clearence < 0").check({"clearance", "force"})
