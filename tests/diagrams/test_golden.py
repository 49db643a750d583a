"""Every scenario measures what it did."""

import pytest

from tests.golden import differences, figures, golden, strayed

GOLDEN = golden()
LONG = {
    *("resect_auto_large", "resect_auto_small", "resect_paper", "resect_refused"),
    *("gauze_breathing_real", "snake_wire_break"),
}
"""Rows that no other test needs."""


def marks(row):
    """Long rows are studies."""
    return [pytest.mark.study] if row in LONG else []


@pytest.mark.parametrize("row", [pytest.param(r, marks=marks(r)) for r in GOLDEN])
def test_figures_are_golden(row):
    assert strayed(row, GOLDEN[row], figures(row)) == []


def test_a_difference_is_told():
    old = {"a": 1.0, "b": [1, {"c": None}], "gone": 0.0}
    same = {"a": 1.0 + 1e-10, "b": [1, {"c": None}], "gone": 0.0}
    assert differences(old, same) == []
    assert differences(old, {**old, "a": 1.04}, part=0.05) == []
    new = {"a": 1.0 + 1e-8, "b": [1, {"c": 0.0}], "late": 0.0}
    assert differences(old, new, "x") == [
        "x.a: 1.0 -> 1.00000001",
        "x.b[1].c: None -> 0.0",
        "x.gone: gone",
        "x.late: new",
    ]
