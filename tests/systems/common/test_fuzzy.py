"""The fuzzy engine against scikit-fuzzy and by hand."""

import numpy as np
import pytest
import skfuzzy

from systems.common.fuzzy import RuleTable, activations, degrees, weighted_mean

GRID = np.linspace(-1.0, 5.0, 241)


def test_degrees_are_scikit_fuzzys_triangles_with_open_ends():
    centers = np.array([0.0, 1.0, 1.5, 4.0])
    got = np.array([degrees(centers, x) for x in GRID]).T
    np.testing.assert_allclose(got.sum(axis=0), 1.0)
    assert ((got > 0.0).sum(axis=0) <= 2).all()
    np.testing.assert_allclose(got[1], skfuzzy.trimf(GRID, (0, 1, 1.5)))
    np.testing.assert_allclose(got[2], skfuzzy.trimf(GRID, (1, 1.5, 4)))
    np.testing.assert_allclose(got[0], skfuzzy.trapmf(GRID, (-9, -9, 0, 1)))
    np.testing.assert_allclose(got[3], skfuzzy.trapmf(GRID, (1.5, 4, 9, 9)))


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


def inferred(rules, rows, columns):
    """What a table concludes from its antecedents' degrees."""
    fired = activations(
        rules.cells, len(rules.values), np.array(rows), np.array(columns)
    )
    return fired, weighted_mean(fired, rules.values)


def test_inference_is_scikit_fuzzys_with_narrow_sets():
    rng = np.random.default_rng(1)
    table = [["a", "b", "c"], ["b", "b", "a"], ["c", "a", "d"]]
    values = {"a": [0.0], "b": [0.3], "c": [0.7], "d": [1.0]}
    rules = RuleTable(table, values)
    for _ in range(10):
        rows, columns = rng.uniform(size=(2, 3)).tolist()
        assert inferred(rules, rows, columns)[1][0] == pytest.approx(
            mamdani(rows, columns, table, values), abs=1e-3
        )


def test_activations_take_the_minimum_and_the_maximum():
    rules = RuleTable([["a", "b"], ["b", "a"]], {"a": [1.0], "b": [0.0]})
    assert rules.cells.tolist() == [[0, 1], [1, 0]]
    assert rules.values.tolist() == [[1.0], [0.0]]
    # a fires with min(.7, .2) and min(.3, .8); b with min(.7, .8), min(.3, .2).
    fired, mean = inferred(rules, [0.7, 0.3], [0.2, 0.8])
    assert fired.tolist() == [0.3, 0.7]
    assert mean.tolist() == [pytest.approx(0.3)]


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: RuleTable([["a"], ["a", "a"]], {"a": [1]}), "unequal length"),
        (lambda: RuleTable([["a", "z"]], {"a": [1]}), r"no value for \['z'\]"),
        (lambda: RuleTable([["a", "b"]], {"a": [1], "b": []}), "unequal length"),
        (
            lambda: inferred(RuleTable([["a"]], {"a": [1]}), [0.0], [1.0]),
            "no rule fires",
        ),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
