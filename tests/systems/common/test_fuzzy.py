"""The fuzzy engine against scikit-fuzzy and by hand."""

from math import inf

import numpy as np
import pytest
import skfuzzy

from systems.common.fuzzy import (
    Partition,
    RuleTable,
    Variable,
    cosine,
    trapezoid,
    triangle,
)

GRID = np.linspace(-1.0, 5.0, 241)


@pytest.mark.parametrize("corners", [(0, 1, 3), (1, 1, 2), (0.5, 2, 2)])
def test_triangle_is_scikit_fuzzys(corners):
    expected = skfuzzy.trimf(GRID, corners)
    np.testing.assert_allclose([triangle(*corners)(x) for x in GRID], expected)


@pytest.mark.parametrize("corners", [(0, 1, 3, 4), (1, 1, 2, 2.5), (0, 2, 2, 3)])
def test_trapezoid_is_scikit_fuzzys(corners):
    expected = skfuzzy.trapmf(GRID, corners)
    np.testing.assert_allclose([trapezoid(*corners)(x) for x in GRID], expected)


def test_open_shoulders():
    low, high = trapezoid(-inf, -inf, 0, 1), trapezoid(0, 1, inf, inf)
    assert low(-100) == 1.0 and low(0.25) == 0.75 and low(2) == 0.0
    assert high(100) == 1.0 and high(0.25) == 0.25 and high(-1) == 0.0


def test_cosine_neighbours_sum_to_one():
    left, right = cosine(0.0, 1.0), cosine(1.0, 1.0)
    assert left(0.0) == 1.0 and left(1.0) == 0.0 and left(-0.5) == pytest.approx(0.5)
    for x in np.linspace(0, 1, 11):
        assert left(x) + right(x) == pytest.approx(1.0)


def test_variable_gives_degrees_in_order():
    variable = Variable({"low": triangle(0, 0, 2), "high": triangle(0, 2, 2)})
    assert variable.labels == ["low", "high"]
    assert variable.degrees(0.5) == [0.75, 0.25]


def test_partition_is_scikit_fuzzys_triangles_with_open_ends():
    centers = [0.0, 1.0, 1.5, 4.0]
    partition = Partition(["a", "b", "c", "d"], centers)
    degrees = np.array([partition.degrees(x) for x in GRID]).T
    np.testing.assert_allclose(degrees.sum(axis=0), 1.0)
    np.testing.assert_allclose(degrees[1], skfuzzy.trimf(GRID, (0, 1, 1.5)))
    np.testing.assert_allclose(degrees[2], skfuzzy.trimf(GRID, (1, 1.5, 4)))
    np.testing.assert_allclose(degrees[0], skfuzzy.trapmf(GRID, (-9, -9, 0, 1)))
    np.testing.assert_allclose(degrees[3], skfuzzy.trapmf(GRID, (1.5, 4, 9, 9)))


def mamdani(rows, columns, table, values):
    """Centroid by scikit-fuzzy, with narrow output sets of equal width."""
    universe = np.linspace(-0.1, 1.1, 12001)
    fired = np.zeros_like(universe)
    for i, cells in enumerate(table):
        for j, label in enumerate(cells):
            c = values[label][0]
            output = skfuzzy.trapmf(universe, (c - 5e-4, c - 5e-4, c + 5e-4, c + 5e-4))
            fired = np.fmax(fired, np.fmin(min(rows[i], columns[j]), output))
    return skfuzzy.defuzz(universe, fired, "centroid")


def test_inference_is_scikit_fuzzys_with_narrow_sets():
    rng = np.random.default_rng(1)
    table = [["a", "b", "c"], ["b", "b", "a"], ["c", "a", "d"]]
    values = {"a": [0.0], "b": [0.3], "c": [0.7], "d": [1.0]}
    rules = RuleTable(table, values)
    for _ in range(10):
        rows, columns = rng.uniform(size=(2, 3)).tolist()
        assert rules.infer(rows, columns)[0] == pytest.approx(
            mamdani(rows, columns, table, values), abs=1e-3
        )


def test_activations_take_the_minimum_and_the_maximum():
    rules = RuleTable([["a", "b"], ["b", "a"]], {"a": [1.0], "b": [0.0]})
    # a fires with min(.7, .2) and min(.3, .8); b with min(.7, .8), min(.3, .2).
    assert rules.activations([0.7, 0.3], [0.2, 0.8]) == [0.3, 0.7]
    assert rules.infer([0.7, 0.3], [0.2, 0.8]) == [pytest.approx(0.3)]


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: trapezoid(0, 2, 1, 3), "expected a <= b <= c <= d"),
        (lambda: cosine(0, 0), "half_width=0"),
        (lambda: Partition(["a", "b"], [1.0, 1.0]), "must increase"),
        (lambda: Partition(["a"], [1.0, 2.0]), "2 centers"),
        (lambda: RuleTable([["a"], ["a", "a"]], {"a": [1]}), "unequal length"),
        (lambda: RuleTable([["a", "z"]], {"a": [1]}), r"no value for \['z'\]"),
        (lambda: RuleTable([["a", "b"]], {"a": [1], "b": []}), "unequal length"),
        (lambda: RuleTable([["a"]], {"a": [1]}).infer([0.0], [1.0]), "no rule fires"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
