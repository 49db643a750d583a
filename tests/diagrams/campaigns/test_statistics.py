"""Intervals hold what they promise."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from diagrams.campaigns.statistics import (
    compared,
    median_interval,
    running_interval,
    share_interval,
    upper_bound,
)


@pytest.mark.parametrize(("p", "n"), [(0.001, 1000), (0.05, 200), (0.5, 40)])
def test_exact_intervals_cover_at_least_what_they_say(p, n):
    counts = np.arange(n + 1)
    weights = binom.pmf(counts, n, p)
    seen = counts[weights > 1e-12]
    inside = [a <= p <= b for a, b in (share_interval(int(k), n) for k in seen)]
    assert weights[seen][inside].sum() >= 0.95
    below = [p <= upper_bound(int(k), n) for k in seen]
    assert weights[seen][below].sum() >= 0.95


def test_zero_of_a_thousand():
    assert share_interval(0, 1000) == (0.0, pytest.approx(0.003682, abs=1e-6))
    assert upper_bound(0, 1000) == pytest.approx(0.002991, abs=1e-6)
    assert upper_bound(0, 10_000) == pytest.approx(0.0003, abs=1e-6)
    assert share_interval(5, 5)[1] == upper_bound(5, 5) == 1.0


def test_running_interval_holds_at_all_times_at_once():
    rng = np.random.default_rng(5)
    p, misses = 0.03, 0
    for _ in range(150):
        counts = np.cumsum(rng.random(1500) < p)
        looks = range(50, 1501, 50)
        bounds = [running_interval(int(counts[n - 1]), n) for n in looks]
        misses += not all(low <= p <= high for low, high in bounds)
    assert misses / 150 <= 0.05


def test_running_interval_at_the_ends():
    assert running_interval(0, 0) == (0.0, 1.0)
    low, high = running_interval(0, 5000)
    assert low == 0.0
    assert high == pytest.approx(0.00156, abs=1e-5)
    assert running_interval(7, 7)[1] == 1.0


def test_median_interval_covers():
    rng = np.random.default_rng(6)
    true = math.log(2.0)
    hits = 0
    for _ in range(400):
        _, low, high = median_interval(rng.exponential(size=25))
        hits += low <= true <= high
    assert hits / 400 >= 0.95
    assert median_interval([1.0, 2.0])[1:] == (-math.inf, math.inf)


def test_pairs():
    found = compared([True] * 9 + [False], [False] * 8 + [True, True])
    assert (found.only_first, found.only_second) == (8, 1)
    assert found.p_value == pytest.approx(2 * 10 / 512)
    assert compared([True, False], [True, False]).p_value == 1.0
