"""Noise of a six-axis sensor as a pure function of seed and sample number.

A counter-based generator (Philox) is keyed by the seed and the block of samples,
so that the reading number i is the same whoever asks, and however often.
"""

from functools import lru_cache

import numpy as np

_BLOCK = 1024


@lru_cache(maxsize=256)
def _normal(seed: int, block: int, stream: int) -> np.ndarray:
    """Standard normal numbers, shape (1024, 6)."""
    key = np.random.SeedSequence([seed, stream, block + 1]).generate_state(2, np.uint64)
    return np.random.Generator(np.random.Philox(key=key)).standard_normal((_BLOCK, 6))


@lru_cache(maxsize=256)
def _walk(seed: int, block: int) -> np.ndarray:
    """A random walk of unit steps, shape (1024, 6)."""
    before = _walk(seed, block - 1)[-1] if block > 0 else np.zeros(6)
    return before + np.cumsum(_normal(seed, block, 1), axis=0)


def white(seed: int, sample: int) -> np.ndarray:
    """White noise of unit variance at a sample >= 0, shape (6,)."""
    return _normal(seed, sample // _BLOCK, 0)[sample % _BLOCK]


def walk(seed: int, sample: int) -> np.ndarray:
    """Random walk of unit steps at a sample >= 0, shape (6,)."""
    return _walk(seed, sample // _BLOCK)[sample % _BLOCK]


def mean_before_start(seed: int, samples: int) -> np.ndarray:
    """Mean of `samples` readings of white noise before sample 0, shape (6,)."""
    if samples <= 0:
        return np.zeros(6)
    blocks = -(-samples // _BLOCK)
    rows = np.vstack([_normal(seed, block, 2) for block in range(blocks)])
    return rows[:samples].mean(axis=0)
