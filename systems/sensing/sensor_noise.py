"""Noise of a six-axis sensor as a pure function of seed and sample number.

A counter-based generator (Philox) is keyed by the seed and the block of samples,
so that the reading number i is the same whoever asks, and however often.
"""

from functools import lru_cache

import numpy as np

type Faults = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]

_BLOCK = 1024
_KEPT = 8
"""Blocks that are kept; a run needs one at a time."""
_STRIDE = 100
"""Blocks of a walk at the most that are called one within the other."""


@lru_cache(maxsize=_KEPT)
def _normal(seed: int, block: int, stream: int) -> np.ndarray:
    """Standard normal numbers, shape (1024, 6)."""
    key = np.random.SeedSequence([seed, stream, block + 1]).generate_state(2, np.uint64)
    return np.random.Generator(np.random.Philox(key=key)).standard_normal((_BLOCK, 6))


@lru_cache(maxsize=4096)
def _walked(seed: int, blocks: int) -> np.ndarray:
    """Where a random walk of unit steps is after so many blocks, shape (6,)."""
    for before in range(_STRIDE, blocks, _STRIDE):
        _walked(seed, before)
    return _walk(seed, blocks - 1)[-1].copy() if blocks > 0 else np.zeros(6)


def _walk(seed: int, block: int) -> np.ndarray:
    """A block of the walk, shape (1024, 6)."""
    return _walked(seed, block) + np.cumsum(_normal(seed, block, 1), axis=0)


@lru_cache(maxsize=_KEPT)
def _faults(seed: int, block: int, faults: Faults) -> np.ndarray:
    white, drift, offset = faults
    return _normal(seed, block, 0) * white + _walk(seed, block) * drift + offset


def fault(seed: int, sample: int, faults: Faults) -> np.ndarray:
    """What noise adds to the reading of a sample >= 0, shape (6,).

    Args:
        seed: Of the sensor.
        sample: Number of the reading.
        faults: Standard deviation of each axis' white noise, step of its random
            walk in each sample, and its constant offset (6 each).
    """
    return _faults(seed, sample // _BLOCK, faults)[sample % _BLOCK]


def mean_before_start(seed: int, samples: int) -> np.ndarray:
    """Mean of `samples` readings of white noise before sample 0, shape (6,)."""
    if samples <= 0:
        return np.zeros(6)
    blocks = -(-samples // _BLOCK)
    rows = np.vstack([_normal(seed, block, 2) for block in range(blocks)])
    return rows[:samples].mean(axis=0)
