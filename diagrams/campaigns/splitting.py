"""Rare failures by splitting: subset simulation over a run's standard normal numbers.

Au and Beck, 2001; with levels and step sizes that a pilot has found and that are then
frozen, independent replicates are free of bias (Cerou et al., 2012). The level of a
run is a figure that falls towards failure. Of the runs below a level others are bred
by moves that keep the normal distribution (preconditioned Crank-Nicolson) and stay
below it; the probability is the product of the shares that get from level to level.

A second, narrow way to fail that the pilot misses is missed by all replicates, and no
figure shows it: set a plain sample beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from scipy.stats import t as student

from systems.common.parameter import parameter

type Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Of points (n, d): their levels (n), smaller is worse, and the points with what
further numbers were asked for (n, d or more); what a point did not ask for is NaN."""


@dataclass
class SplittingParams:
    """How rare failures are looked for."""

    level: str = parameter("", "the figure that falls towards failure")
    rises: bool = parameter(False, "whether it rises instead")
    failure: float = parameter(0.0, "a run fails beyond this", least=-1e9, most=1e9)
    population: int = parameter(300, "of runs at each level", least=20, most=100_000)
    share: float = parameter(
        0.2, "of them that reach the next level", least=0.02, most=0.5
    )
    moves: int = parameter(5, "of each run at each level", least=1, most=100)
    replicates: int = parameter(
        8, "independent ones, after the pilot", least=2, most=1000
    )
    levels: int = parameter(20, "at the most", least=1, most=100)


@dataclass(frozen=True)
class Ladder:
    """What a pilot found: levels from easy to failure, and a step size at each."""

    levels: list[float]
    steps: list[float]


@dataclass(frozen=True)
class Estimate:
    """A probability by splitting.

    Attributes:
        probability: The replicates' mean.
        low, high: 95 % of a t distribution of the mean's logarithm; 0 and 1 if fewer
            than two replicates found a failure.
        each: Of every replicate.
        runs: All that were evaluated, with the pilot's.
        ladder: That the replicates kept to.
        worst: The point of the lowest level.
        lowest: Its level.
    """

    probability: float
    low: float
    high: float
    each: list[float]
    runs: int
    ladder: Ladder
    worst: np.ndarray
    lowest: float


@dataclass
class _Search:
    """Evaluates, and remembers the worst."""

    evaluate: Evaluate
    rng: np.random.Generator
    runs: int = 0
    lowest: float = math.inf
    worst: np.ndarray | None = None

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        levels, points = self.evaluate(points)
        self.runs += len(points)
        # A number that was not asked for is as free as before it was drawn.
        unused = np.isnan(points)
        points = np.where(unused, self.rng.standard_normal(points.shape), points)
        least = int(np.argmin(levels))
        if levels[least] < self.lowest:
            self.lowest, self.worst = float(levels[least]), points[least]
        return levels, points

    def widened(self, points: np.ndarray, width: int) -> np.ndarray:
        """Points with columns that have come up since."""
        more = self.rng.standard_normal((len(points), width - points.shape[1]))
        return np.hstack([points, more])


def estimate(
    evaluate: Evaluate, width: int, params: SplittingParams, seed: int
) -> Estimate:
    """Estimates how probable it is that the level of a random point fails.

    Args:
        evaluate: Gives points' levels; falling, whatever `params.rises` says.
        width: Number of columns to begin with.
        params: How it is done; `failure` is the level of failure.
        seed: Of all randomness.
    """
    search = _Search(evaluate, np.random.default_rng([seed, 0]))
    ladder = pilot(search, width, params)
    each = []
    for number in range(params.replicates):
        search.rng = np.random.default_rng([seed, 1 + number])
        each.append(replicate(search, width, params, ladder))
    mean = float(np.mean(each))
    low, high = 0.0, 1.0
    if np.count_nonzero(each) > 1:
        error = float(np.std(each, ddof=1)) / math.sqrt(len(each)) / mean
        spread = math.exp(float(student.ppf(0.975, len(each) - 1)) * error)
        low, high = mean / spread, min(1.0, mean * spread)
    assert search.worst is not None
    return Estimate(
        mean, low, high, each, search.runs, ladder, search.worst, search.lowest
    )


def pilot(search: _Search, width: int, params: SplittingParams) -> Ladder:
    """Finds the levels, each reached by a share of the population, and the steps."""
    levels, points = search(search.rng.standard_normal((params.population, width)))
    ladder = Ladder([], [])
    step = 0.6
    for _ in range(params.levels):
        level = max(float(np.quantile(levels, params.share)), params.failure)
        ladder.levels.append(level)
        if level <= params.failure:
            break
        levels, points, step = _bred(search, levels, points, level, step, params, True)
        ladder.steps.append(step)
    return ladder


def replicate(
    search: _Search, width: int, params: SplittingParams, ladder: Ladder
) -> float:
    """One unbiased estimate on a frozen ladder; 0 if it did not get to its end."""
    levels, points = search(search.rng.standard_normal((params.population, width)))
    probability = 1.0
    for number, level in enumerate(ladder.levels):
        probability *= float(np.mean(levels <= level))
        if not probability or number == len(ladder.steps):
            break
        levels, points, _ = _bred(
            search, levels, points, level, ladder.steps[number], params, False
        )
    return probability if ladder.levels[-1] <= params.failure else 0.0


def _bred(
    search: _Search,
    levels: np.ndarray,
    points: np.ndarray,
    level: float,
    step: float,
    params: SplittingParams,
    adapts: bool,
) -> tuple[np.ndarray, np.ndarray, float]:
    """A population below a level, of those that are there, moved `moves` times.

    Half of the moves are of all numbers, half of some: of a whole vector few moves
    are taken when a run hangs on many numbers. While it adapts, the step is brought
    to where three of ten moves are taken.
    """
    rng = search.rng
    below = np.flatnonzero(levels <= level)
    chosen = rng.permutation(np.resize(rng.permutation(below), params.population))
    levels, points = levels[chosen], points[chosen]
    for move in range(params.moves):
        n, width = points.shape
        noise = rng.standard_normal((n, width))
        tried = math.sqrt(1.0 - step * step) * points + step * noise
        if move % 2:
            some = rng.random((n, width)) < rng.uniform(0.1, 0.5, (n, 1))
            tried = np.where(some, tried, points)
        new, tried = search(tried)
        points = search.widened(points, tried.shape[1])
        taken = new <= level
        levels = np.where(taken, new, levels)
        points = np.where(taken[:, np.newaxis], tried, points)
        if adapts:
            step = min(0.99, step * math.exp(float(np.mean(taken)) - 0.3))
    return levels, points, step


def shrunk(
    numbers: dict[str, float],
    fails: Callable[[list[dict[str, float]]], list[bool]],
    factors: tuple[float, ...] = (0.0, 0.5, 0.8, 0.95),
    rounds: int = 2,
) -> dict[str, float]:
    """The draw nearest to the nominal one that still fails, group by group.

    A group are the numbers whose keys begin alike. The nominal draw is zero.

    Args:
        numbers: Of a run that fails, by key.
        fails: Says of draws whether they fail; asked for several at once.
        factors: Tried on each group, the smallest that fails is taken.
        rounds: Through all groups.
    """
    groups = sorted({key.split(".")[0] for key in numbers})
    for _ in range(rounds):
        for group in groups:
            tried = [
                {
                    k: v * (f if k.split(".")[0] == group else 1.0)
                    for k, v in numbers.items()
                }
                for f in factors
            ]
            found = [one for one, bad in zip(tried, fails(tried), strict=True) if bad]
            numbers = found[0] if found else numbers
    return numbers
