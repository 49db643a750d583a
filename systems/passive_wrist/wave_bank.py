"""The fulcrum of a breathing wall from a short record: linear fits over the rate.

A filter that follows an unknown wave cannot tell it from an error of its depth
under a turning shaft: the depth runs away until the rate is known. Given a rate,
everything is linear, the compliance kappa = 1/K included. With e across the shaft u,
f the wall's lateral force, p_S the sensor and t counted from now,

    e . (c + sum_k a_k cos(k w t) - b_k sin(k w t)) - kappa e . f = e . p_S

so that the record is fitted at every rate of a grid, and the fits are weighed by
their evidence. Half the true rate holds the wave as well: the *highest* rate is taken
of the maxima that are nearly the best. The fulcrum now is c + sum_k a_k.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_kernels import RECORD_PERIOD
from systems.passive_wrist.fulcrum_step import HARMONICS

RATES = np.geomspace(0.12, 0.50, 61)  # [Hz] 2.4 % apart
_NEAR = np.exp(0.015 * np.arange(-1.0, 2.0))  # rates about a known one
_PARTS = 1 + 2 * HARMONICS
_SIZE = 3 * _PARTS + 1
_MISSED = 3e-4  # [m] what the harmonics may miss of a wave, rms
_CORRELATED = 1.8  # times the residual: what is missed of a wave is no white noise
_AMPLITUDE = 5e-3  # [m] prior of the first harmonic; of the k-th the k^2-th part
_LENGTHWISE = 2.0  # times that along the shaft
_NEARLY = 15.0  # log evidence below the best
_PEAK = 4  # grid points either way that belong to a maximum
_LEAST_DOUBT = 0.05  # of ln K


@dataclass
class WaveFit:
    """A record's fit at the rate that is taken.

    Attributes:
        rate: In Hz.
        x: c (3), a_1, b_1, a_2, ... (3 each), kappa; in m and m/N, shape (n,).
        P: Its covariance, that of the rate's own doubt in it, shape (n, n).
        rate_sigma: Standard deviation of ln rate.
        share: Of the evidence that lies in the maximum taken, in [0, 1].
    """

    rate: float
    x: np.ndarray
    P: np.ndarray
    rate_sigma: float
    share: float

    def lateral(self, u: np.ndarray) -> float:
        """Rms of the first harmonic across u (3), in m."""
        parts = self.x[3:9].reshape(2, 3)
        return float(np.sqrt(0.5 * (parts**2).sum() - 0.5 * ((parts @ u) ** 2).sum()))

    def along(self, u: np.ndarray) -> float:
        """Standard deviation of the fulcrum along u (3) at the record's end, in m."""
        row = np.zeros(_SIZE)
        for column in (0, *range(3, _SIZE - 1, 6)):
            row[column : column + 3] = u
        return float(np.sqrt(row @ self.P @ row))


def _waves(rates: np.ndarray, entries: int) -> np.ndarray:
    """1, cos(m w t), sin(m w t), m up to twice the harmonics; (rates, :, entries)."""
    # An entry is the mean of a tenth of a second: half of that old.
    t = -RECORD_PERIOD * (np.arange(entries)[::-1] + 0.5)
    phase = 2.0 * np.pi * rates[:, None] * t
    rows = [np.ones_like(phase)]
    for m in range(1, 2 * HARMONICS + 1):
        rows += [np.cos(m * phase), np.sin(m * phase)]
    return np.stack(rows, axis=1)


@cache
def _grid(entries: int) -> np.ndarray:
    """The waves of the whole grid."""
    return _waves(RATES, entries)


@cache
def _products() -> np.ndarray:
    """Products of two basis functions 1, cos, -sin, ... as such waves."""
    table = np.zeros((_PARTS, _PARTS, 4 * HARMONICS + 1))

    def cosine(m: int) -> int:
        return 2 * abs(m) - 1 if m else 0

    for i in range(_PARTS):
        for j in range(_PARTS):
            k, n = (i + 1) // 2, (j + 1) // 2
            if i % 2 == 0 and i and j % 2 == 0 and j:  # sin sin
                table[i, j, cosine(k - n)] += 0.5
                table[i, j, cosine(k + n)] -= 0.5
            elif (i % 2 or not i) and (j % 2 or not j):  # cos cos
                table[i, j, cosine(k - n)] += 0.5
                table[i, j, cosine(k + n)] += 0.5
            else:  # -sin(a) cos(b)
                a, b = (k, n) if i and i % 2 == 0 else (n, k)
                table[i, j, 2 * (a + b)] -= 0.5
                if a != b:
                    table[i, j, 2 * abs(a - b)] -= 0.5 * np.sign(a - b)
    return table.reshape(_PARTS**2, -1)


class _Sums:
    """A record, summed up for the fits at any rate."""

    def __init__(
        self, params: FulcrumParams, record: Any, stiffness: float, doubt: float
    ) -> None:
        """Takes a view of an `Entry` (n, 3), and what is known of K."""
        u, self.origin = record.u, np.array(params.guess)
        u = u / np.linalg.norm(u, axis=1)[:, None]
        depth = np.maximum(((self.origin - record.p) * u).sum(axis=1), 0.02)[:, None]
        # Force and moment are two readings of one force.
        by_moment = np.cross(record.m, u) / depth
        weight = depth**2 * params.force_noise**2
        weight = weight / (weight + params.moment_noise**2)
        f = (1.0 - weight) * record.f + weight * by_moment
        P = np.eye(3) - u[:, :, None] * u[:, None, :]
        p = np.einsum("nij,nj->ni", P, record.p - self.origin)
        f = np.einsum("nij,nj->ni", P, f)
        self.kappa, self.doubt = 1.0 / stiffness, max(doubt, _LEAST_DOUBT)
        self.bias = params.force_bias * self.kappa
        self.noise = float(np.hypot(_MISSED, self.bias))
        # kappa counts in shares of what it is believed to be: all unknowns are small.
        f = f * self.kappa
        self.data = np.concatenate([P.reshape(-1, 9), p, f], axis=1)
        self.ff, self.fp = float((f * f).sum()), float((f * p).sum())
        self.pp = float((p * p).sum())
        axis = u.mean(axis=0)
        self.prior = self._prior(params, axis / np.linalg.norm(axis))

    def _prior(self, params: FulcrumParams, axis: np.ndarray) -> np.ndarray:
        """Information of the prior, whose mean is the guess."""
        information = np.zeros((_SIZE, _SIZE))
        along = np.outer(axis, axis)
        information[:3, :3] = np.eye(3) / params.guess_sigma**2
        for i in range(1, _PARTS):
            k = (i + 1) // 2
            part = np.eye(3) - along + along / _LENGTHWISE**2
            at = slice(3 * i, 3 * i + 3)
            information[at, at] = part * (k * k / _AMPLITUDE) ** 2
        information[-1, -1] = 1.0 / self.doubt**2
        return information

    def normal(self, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrices (r, n, n) and right sides (r, n) of the rows, at r rates."""
        count = len(waves)
        sums = waves @ self.data
        L = np.empty((count, _SIZE, _SIZE))
        blocks = (_products() @ sums[:, :, :9]).reshape(count, _PARTS, _PARTS, 3, 3)
        L[:, :-1, :-1] = blocks.swapaxes(2, 3).reshape(count, _SIZE - 1, _SIZE - 1)
        # The basis itself: 1, cos, -sin, ...
        sign = np.ones(_PARTS)
        sign[2::2] = -1.0
        right = sign[:, None] * sums[:, :_PARTS, 9:]
        L[:, :-1, -1] = L[:, -1, :-1] = -right[:, :, 3:].reshape(count, -1)
        L[:, -1, -1] = self.ff
        b = np.empty((count, _SIZE))
        b[:, :-1], b[:, -1] = right[:, :, :3].reshape(count, -1), -self.fp
        return L, b

    def weighed(
        self, L: np.ndarray, b: np.ndarray, noise: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Information and right sides at a noise in m, with the prior's."""
        b = b / noise**2
        b[..., -1] += 1.0 / self.doubt**2  # kappa's prior mean is 1
        return L / noise**2 + self.prior, b

    def evidence(self, L: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Log evidence of each fit, but for a constant, shape (r,)."""
        # [L b; b' c] has the Cholesky factor of L and below it c - b' L^-1 b.
        c = self.pp / self.noise**2 + 1.0 / self.doubt**2 + 1.0
        both = np.concatenate([L, b[:, None, :]], axis=1)
        right = np.concatenate([b, np.full((len(b), 1), c)], axis=1)
        both = np.concatenate([both, right[:, :, None]], axis=2)
        diagonal = np.einsum("rii->ri", np.linalg.cholesky(both))
        volume = np.log(diagonal[:, :-1]).sum(axis=1)
        return -0.5 * diagonal[:, -1] ** 2 - volume

    def residual(self, N: np.ndarray, n: np.ndarray, x: np.ndarray) -> float:
        """Rms in m of what a solution x leaves of the rows."""
        squares = x @ N @ x - 2.0 * x @ n + self.pp
        return float(np.sqrt(max(squares, 0.0) / (2 * len(self.data))))


def fit_waves(
    params: FulcrumParams,
    record: Any,
    stiffness: float,
    doubt: float,
    known: float = 0.0,
) -> WaveFit | None:
    """Fits a breathing wall to a record.

    Args:
        params: Noise, guess and its sigma.
        record: View of an `Entry`: p, u, f, m (n, 3), the oldest first.
        stiffness: K as believed, in N/m.
        doubt: Standard deviation of ln K.
        known: A rate in Hz: only rates near it are tried. 0 for all of the grid.

    Returns:
        The fit; None if no rate inside the grid is a maximum of the evidence.
    """
    sums = _Sums(params, record, stiffness, doubt)
    entries = len(record.u)
    rates = known * _NEAR if known else RATES
    normal = sums.normal(_waves(rates, entries) if known else _grid(entries))
    L, b = sums.weighed(*normal, sums.noise)
    evidence = sums.evidence(L, b)
    inner = evidence[1:-1]
    peaks = np.flatnonzero((inner >= evidence[:-2]) & (inner > evidence[2:])) + 1
    if not len(peaks):
        return None
    # Maxima lie between grid points: a parabola through three of them.
    before, at, after = (evidence[peaks + k] for k in (-1, 0, 1))
    bends = 2.0 * at - before - after
    shifts = 0.5 * (after - before) / bends
    heights = at + 0.25 * (after - before) * shifts
    taken = int(np.flatnonzero(heights > heights.max() - _NEARLY)[-1])
    i, bend, step = int(peaks[taken]), bends[taken], np.log(rates[1] / rates[0])
    rate = float(rates[i] * np.exp(shifts[taken] * step))
    sides = np.linalg.solve(L[i - 1 : i + 2 : 2], b[i - 1 : i + 2 : 2, :, None])
    (N,), (n,) = sums.normal(_waves(np.array([rate]), entries))
    L_best, b_best = sums.weighed(N, n, sums.noise)
    # Evidence and estimate suppose the most that may be missed; the estimate is as
    # sure as what it left says.
    best = np.linalg.solve(L_best, b_best)
    noise = float(np.hypot(_CORRELATED * sums.residual(N, n, best), sums.bias))
    P = np.linalg.inv(sums.weighed(N, n, noise)[0])
    rate_sigma = step / np.sqrt(bend) * noise / sums.noise
    slope = (sides[1] - sides[0])[:, 0] / (2.0 * step) * rate_sigma
    likely = np.abs(rates / rates[i] - 0.5) > 0.06  # half of it holds the wave as well
    weight = np.where(likely, np.exp(np.minimum(evidence - evidence[i], 50.0)), 0.0)
    near = weight[max(i - _PEAK, 0) : i + _PEAK + 1].sum()
    best[:3] += sums.origin
    scale = np.ones(_SIZE)
    scale[-1] = sums.kappa
    return WaveFit(
        rate=rate,
        x=best * scale,
        P=(P + np.outer(slope, slope)) * np.outer(scale, scale),
        rate_sigma=float(rate_sigma),
        share=float(near / weight.sum()),
    )
