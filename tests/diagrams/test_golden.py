"""Every scenario measures what it did."""

import pytest

from tests.golden import differences, figures, golden

GOLDEN = golden()
LONG = {"resect_auto_small", "resect_paper", "resect_refused", "snake_wire_break"}
"""Rows that no other test needs."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.study] if n in LONG else []) for n in GOLDEN],
)
def test_figures_are_golden(name):
    assert differences(GOLDEN[name], figures(name), name) == []


def test_a_difference_is_told():
    old = {"a": 1.0, "b": [1, {"c": None}], "gone": 0.0}
    same = {"a": 1.0 + 1e-10, "b": [1, {"c": None}], "gone": 0.0}
    assert differences(old, same) == []
    new = {"a": 1.0 + 1e-8, "b": [1, {"c": 0.0}], "late": 0.0}
    assert differences(old, new, "x") == [
        "x.a: 1.0 -> 1.00000001",
        "x.b[1].c: None -> 0.0",
        "x.gone: gone",
        "x.late: new",
    ]
