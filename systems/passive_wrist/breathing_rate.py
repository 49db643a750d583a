"""The breathing rate from a short record of the fulcrum's lateral motion.

An extended Kalman filter that starts with a wrong rate locks onto half of it as
easily: two harmonics of f/2 hold the wave of f. So the rate is not left to the
filter: constant + two harmonics are fitted by least squares to the last seconds,
for a grid of rates, and the *highest* rate whose fit is nearly as good as the
best one is taken. Half the true rate fits as well as the rate itself, but is
lower; twice the true rate misses the fundamental and fits badly.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

RATES = np.geomspace(0.10, 0.50, 61)  # [Hz] the grid, 2.7 % apart
_NEARLY = 1.6  # residual power against the best one's
_ENOUGH = 0.02  # residual power against the record's: the grid is coarse
_SEARCHED = 2  # harmonics of the search


@dataclass
class BreathingFit:
    """A periodic motion fitted to a record.

    Attributes:
        rate: In Hz.
        parts: Rms of each harmonic, shape (harmonics,), in m.
        amplitude: Rms of the fitted wave about its mean, in m.
        residual: Rms of what the fit leaves, in m.
    """

    rate: float
    parts: np.ndarray
    amplitude: float
    residual: float


def _basis(rate: np.ndarray, samples: int, period: float, harmonics: int) -> np.ndarray:
    """Columns 1, cos, -sin, ... for each rate, shape (rates, samples, 1 + 2 h)."""
    t = (np.arange(samples) - (samples - 1)) * period
    phase = 2.0 * np.pi * rate[:, None] * t
    columns = [np.ones_like(phase)]
    for k in range(1, harmonics + 1):
        columns += [np.cos(k * phase), -np.sin(k * phase)]
    return np.stack(columns, axis=-1)


@lru_cache(maxsize=64)
def _orthonormal(samples: int, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates that the record's length can tell, and their bases made orthonormal."""
    length = samples * period
    rates = RATES[RATES * length >= 0.5]
    if not len(rates):
        return rates, np.zeros((0, samples, 1))
    return rates, np.linalg.qr(_basis(rates, samples, period, _SEARCHED))[0]


def find_breathing(
    record: np.ndarray, period: float, harmonics: int
) -> BreathingFit | None:
    """Fits a periodic motion to a record.

    Args:
        record: Positions, oldest first, shape (n, 3), in m.
        period: Between samples, in s.
        harmonics: Of the wave that is fitted at the rate found.

    Returns:
        The fit, or None if the record is shorter than one period of it or than
        one period of every rate on the grid. The caller judges its size.
    """
    samples = len(record)
    rates, bases = _orthonormal(samples, period)
    if len(rates) < 3:
        return None
    y = record - record.mean(axis=0)
    power = float((y * y).sum())
    explained = np.matmul(bases.transpose(0, 2, 1), y)
    left = power - (explained**2).sum(axis=(1, 2))
    inner = np.flatnonzero((left[1:-1] <= left[:-2]) & (left[1:-1] < left[2:])) + 1
    good = inner[left[inner] <= max(_NEARLY * left.min(), _ENOUGH * power)]
    if not len(good):
        return None
    i = int(good[-1])
    if rates[i] * samples * period < 0.97:
        return None
    # The minimum between grid points: a parabola through three of them.
    before, at, after = np.sqrt(left[i - 1 : i + 2])
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    rate = float(rates[i] * (rates[i + 1] / rates[i]) ** shift)
    return fit_breathing(record, period, harmonics, rate)


def fit_breathing(
    record: np.ndarray, period: float, harmonics: int, rate: float
) -> BreathingFit:
    """Fits a periodic motion of a known rate to a record; see `find_breathing`."""
    basis = _basis(np.array([rate]), len(record), period, harmonics)[0]
    x, *_ = np.linalg.lstsq(basis, record, rcond=None)
    fitted = basis[:, 1:] @ x[1:]
    rest = record - x[0] - fitted
    squares = (x[1:] ** 2).sum(axis=1)
    return BreathingFit(
        rate=rate,
        parts=np.sqrt(0.5 * (squares[0::2] + squares[1::2])),
        amplitude=float(np.sqrt((fitted**2).sum() / len(record))),
        residual=float(np.sqrt((rest**2).sum() / len(record))),
    )
