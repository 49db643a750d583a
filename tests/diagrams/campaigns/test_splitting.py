"""Splitting on problems whose answer is known, and its warning."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from diagrams.campaigns.splitting import SplittingParams, estimate, shrunk


def linear(beta, d):
    way = np.ones(d) / math.sqrt(d)
    return (lambda x: (beta - x @ way, x)), norm.sf(beta)


def sphere(r, d):
    return (lambda x: (r - np.linalg.norm(x, axis=1), x)), chi2.sf(r * r, d)


PROBLEMS = {
    "linear, 10, 1e-3": (*linear(3.09, 10), 10),
    "linear, 50, 1e-5": (*linear(4.265, 50), 50),
    "linear, 10, 1e-5": (*linear(4.265, 10), 10),
    "sphere, 10, 1e-5": (*sphere(math.sqrt(chi2.isf(1e-5, 10)), 10), 10),
    "sphere, 50, 1e-6": (*sphere(math.sqrt(chi2.isf(1e-6, 50)), 50), 50),
}


def repeated(name, times):
    evaluate, true, d = PROBLEMS[name]
    return true, [estimate(evaluate, d, SplittingParams(), s) for s in range(times)]


@pytest.mark.parametrize("name", PROBLEMS)
def test_known_answers_lie_within_the_interval(name):
    true, found = repeated(name, 8)
    assert sum(e.low <= true <= e.high for e in found) >= 6
    assert np.mean([e.probability for e in found]) == pytest.approx(true, rel=0.2)


@pytest.mark.study
@pytest.mark.parametrize("name", PROBLEMS)
def test_known_answers_of_a_hundred(name):
    true, found = repeated(name, 100)
    assert sum(e.low <= true <= e.high for e in found) >= 90


@pytest.mark.parametrize("name", ["linear, 10, 1e-5", "sphere, 10, 1e-5"])
def test_twenty_times_fewer_runs_than_by_chance(name):
    true, found = repeated(name, 20)
    spread = np.std([e.probability for e in found]) / true
    plain = (1.0 - true) / (true * spread**2)  # runs for the same spread by chance
    assert plain / np.mean([e.runs for e in found]) >= 20.0


def test_second_narrow_branch_is_missed_and_nothing_shows_it():
    # Nearly all of the probability lies where nothing leads to.
    def evaluate(x):
        return np.minimum(5.2 - x[:, 0], np.where(x[:, 1] < -4.75, -1.0, 9.0)), x

    true = norm.sf(5.2) + norm.sf(4.75)
    found = [
        estimate(evaluate, 2, SplittingParams(population=100), s) for s in range(10)
    ]
    covered = sum(e.low <= true <= e.high for e in found)
    assert covered <= 1  # promised: 95 %


def test_columns_may_come_up_on_the_way():
    def evaluate(x):
        n, d = x.shape
        more = np.random.default_rng(n + d).standard_normal((n, max(0, 6 - d)))
        full = np.hstack([x, more])
        return 2.5 - full[:, :6].sum(axis=1) / math.sqrt(6.0), full

    found = estimate(evaluate, 2, SplittingParams(), 1)
    assert found.low <= norm.sf(2.5) <= found.high


def test_shrinking_keeps_the_failure_and_lets_go_of_the_rest():
    start = {"a.x": 3.0, "a.y": 0.5, "b.x": 2.0, "c": -1.0}
    found = shrunk(start, lambda tried: [one["a.x"] > 2.2 for one in tried])
    assert found["a.x"] > 2.2
    assert found["b.x"] == found["c"] == 0.0
    assert found["a.x"] < 3.0
