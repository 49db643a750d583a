"""The breath as one clock for wall and organs, with what disturbs it.

A breath may be longer and deeper than the one before (jitter), quicken, stop for a
while, and be broken by a cough. Without any of these the clock is the time itself.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import exp, pi, sin

import numpy as np
from scipy.interpolate import CubicSpline

from systems.common.parameter import Rules, parameter

COUGH = 0.4
"""Of how long a cough is, in s."""
_EASE = 0.1  # s in which a breath stops, and goes on
_MOST = 4096  # breaths that are drawn


@dataclass
class Irregular:
    """What disturbs a breath."""

    jitter: float = parameter(
        0.0, "relative deviation of each breath's length and depth", least=0.0, most=0.2
    )
    seed: int = parameter(0, "of the jitter", least=0, most=2**63 - 1)
    quicker: float = parameter(0.0, "relative change of the rate", least=-0.5, most=1.0)
    quicker_time: float = parameter(
        60.0, "when it begins to change", "s", least=0.0, most=1e5
    )
    quicker_duration: float = parameter(
        30.0, "in which it changes", "s", above=0.0, most=1e4
    )
    holds: list[float] = parameter(
        [], "the breath is held: start, end, ...", "s", least=0, most=1e5, shape=(-1,)
    )
    coughs: list[float] = parameter(
        [], "when coughs begin", "s", least=0, most=1e5, shape=(-1,)
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        paired = len(self.holds) % 2 == 0 and sorted(self.holds) == self.holds
        yield paired, "holds", "rising times in pairs, e.g. [60.0, 70.0]"

    def clock(self, time: float) -> float:
        """The time of a breath that is neither held nor quickened, in s."""
        done = 0.0
        for start, end in zip(self.holds[::2], self.holds[1::2], strict=True):
            done += _held(time - start, end - start)
        t = time - done
        if self.quicker:
            since = min(max(t - self.quicker_time, 0.0), self.quicker_duration)
            rest = max(t - self.quicker_time - self.quicker_duration, 0.0)
            t += self.quicker * (0.5 * since**2 / self.quicker_duration + rest)
        return t

    def breath(self, time: float, rate: float) -> tuple[float, float]:
        """Phase in breaths, and depth against the usual, of a breath of a rate."""
        if not self.disturbed:
            return rate * time, 1.0
        t = self.clock(time)
        if not self.jitter:
            return rate * t, 1.0
        phase, depths = _breaths(self.jitter, self.seed)
        phi = float(phase(rate * t)) if t > 0.0 else rate * t
        k = min(max(int(phi), 0), len(depths) - 2)
        share = min(max(phi - k, 0.0), 1.0)
        return phi, float(depths[k] + share * (depths[k + 1] - depths[k]))

    @property
    def disturbed(self) -> bool:
        """Whether the clock is not the time."""
        return bool(self.jitter or self.quicker or self.holds)

    def coughing(self, time: float) -> float:
        """How far a cough has thrown everything, in [0, 1]."""
        for start in self.coughs:
            if 0.0 < time - start < COUGH:
                return sin(pi * (time - start) / COUGH) ** 2
        return 0.0


def _held(since: float, length: float) -> float:
    """Time lost to a hold: it begins and ends softly."""
    if since <= 0.0:
        return 0.0
    lost = since - _EASE * (1.0 - exp(-since / _EASE))
    if since > length:
        after = since - length
        lost -= after - _EASE * (1.0 - exp(-after / _EASE))
    return lost


@lru_cache(maxsize=8)
def _breaths(jitter: float, seed: int) -> tuple[CubicSpline, np.ndarray]:
    """Phase of the breaths against time in usual breaths, and their depths."""
    rng = np.random.default_rng(seed)
    lengths = np.exp(jitter * rng.standard_normal(_MOST))
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    phase = CubicSpline(starts, np.arange(_MOST + 1.0))
    return phase, np.exp(jitter * rng.standard_normal(_MOST + 1))
