"""How sure a share, a median or a comparison is, by exact methods.

All were checked for their coverage, see the tests: a share by Clopper and Pearson
(1934); one that is looked at before the end by the confidence sequence of a
beta(1/2, 1/2) mixture (Robbins, 1970); a median by order statistics; pairs by the
exact test of McNemar (1947).
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import betaln
from scipy.stats import beta, binom, binomtest


def share_interval(count: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson's two-sided interval of a probability.

    Args:
        count: Of events.
        of: Number of independent trials, at least 1.
        level: Confidence.
    """
    tail = 0.5 * (1.0 - level)
    low = float(beta.ppf(tail, count, of - count + 1)) if count else 0.0
    high = float(beta.ppf(1.0 - tail, count + 1, of - count)) if count < of else 1.0
    return low, high


def upper_bound(count: int, of: int, level: float = 0.95) -> float:
    """Clopper-Pearson's one-sided upper bound: 0 of 1,000 is at most 0.0030."""
    return float(beta.ppf(level, count + 1, of - count)) if count < of else 1.0


def running_interval(count: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """An interval that may be looked at after every trial, until one stops.

    It holds the probability at all times at once with the confidence `level`, and is
    wider for that.
    """
    if not of:
        return 0.0, 1.0
    mixed = betaln(count + 0.5, of - count + 0.5) - betaln(0.5, 0.5)
    threshold = mixed + math.log(1.0 - level)

    def excess(p: float) -> float:
        one = count * math.log(p) if count else 0.0
        other = (of - count) * math.log1p(-p) if count < of else 0.0
        return one + other - threshold

    best, least = count / of, 1e-15
    low = brentq(excess, least, best) if count and excess(least) < 0.0 else 0.0
    high = brentq(excess, best, 1.0 - least) if count < of else 1.0
    return float(low), float(high)


def median_interval(
    values: Sequence[float] | np.ndarray, level: float = 0.95
) -> tuple[float, float, float]:
    """The median and an interval of order statistics; NaN without values.

    With fewer than six values the interval is all of the line.
    """
    ranked = np.sort(np.asarray(values, dtype=float))
    n = len(ranked)
    if n == 0:
        return math.nan, math.nan, math.nan
    k = int(binom.ppf(0.5 * (1.0 - level), n, 0.5))
    middle = float(np.median(ranked))
    if k == 0:
        return middle, -math.inf, math.inf
    return middle, float(ranked[k - 1]), float(ranked[n - k])


@dataclass(frozen=True)
class Comparison:
    """Two variants on the same draws.

    Attributes:
        only_first: Runs in which only the first one failed.
        only_second: Only the second one.
        p_value: McNemar's exact one, two-sided: small if they differ.
    """

    only_first: int
    only_second: int
    p_value: float


def compared(first: Sequence[bool], second: Sequence[bool]) -> Comparison:
    """McNemar's exact test on pairs of runs, failed or not."""
    pairs = list(zip(first, second, strict=True))
    b = sum(x and not y for x, y in pairs)
    c = sum(y and not x for x, y in pairs)
    return Comparison(b, c, binomtest(b, b + c).pvalue if b + c else 1.0)
