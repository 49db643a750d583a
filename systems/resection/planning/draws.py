"""Random numbers whose state is the caller's: the same seed, the same plan.

numba's own random state belongs to a thread, and functions that take numpy's generators
cannot be cached. This is the Mersenne Twister (Matsumoto and Nishimura 1998) with the
distributions of `numpy.random.RandomState`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.common.compiled import compiled

WORDS = 624


class Draws(NamedTuple):
    """State of a generator; compiled functions change it in place.

    Attributes:
        words: The twister's, 32 bits each, int64 (624).
        used: How many of them have been drawn since the last twist, int64 (1).
        spare: The second normal number of a pair, (1); NaN if it has been drawn.
    """

    words: NDArray[np.int64]
    used: NDArray[np.int64]
    spare: NDArray[np.float64]


def new_draws(seed: int) -> Draws:
    """A generator at its beginning."""
    words = np.random.RandomState(seed).get_state(legacy=False)["state"]["key"]
    return Draws(words.astype(np.int64), np.full(1, WORDS), np.full(1, np.nan))


@compiled
def _word(d: Draws) -> int:
    """The next 32 bits."""
    if d.used[0] == WORDS:
        for i in range(WORDS):
            after = d.words[(i + 1) % WORDS]
            y = (d.words[i] & 0x80000000) | (after & 0x7FFFFFFF)
            twist = 0x9908B0DF if y & 1 else 0
            d.words[i] = d.words[(i + 397) % WORDS] ^ (y >> 1) ^ twist
        d.used[0] = 0
    y = d.words[d.used[0]]
    d.used[0] += 1
    y ^= y >> 11
    y ^= (y << 7) & 0x9D2C5680
    y ^= (y << 15) & 0xEFC60000
    return y ^ (y >> 18)


@compiled
def uniform(d: Draws) -> float:
    """A number of [0, 1)."""
    high = _word(d) >> 5
    return (high * 67108864.0 + (_word(d) >> 6)) / 9007199254740992.0


@compiled
def below(d: Draws, n: int) -> int:
    """One of the whole numbers 0 to n - 1."""
    if n < 2:
        return 0
    mask, drawn = 1, n
    while mask < n:
        mask *= 2
    while drawn >= n:
        drawn = _word(d) & (mask - 1)
    return drawn


@compiled
def normal(d: Draws) -> float:
    """A standard normal number (polar method)."""
    spare = d.spare[0]
    d.spare[0] = math.nan
    if not math.isnan(spare):
        return spare
    x, y, r2 = 0.0, 0.0, 0.0
    while r2 == 0.0 or r2 >= 1.0:
        x, y = 2.0 * uniform(d) - 1.0, 2.0 * uniform(d) - 1.0
        r2 = x * x + y * y
    f = math.sqrt(-2.0 * math.log(r2) / r2)
    d.spare[0] = f * x
    return f * y
