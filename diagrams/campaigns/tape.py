"""What varies from run to run, as a map of standard normal numbers.

Every number has a key. It depends on the campaign's seed, the run and its key only:
not on the order in which numbers are asked for, nor on which others are. A search for
rare failures moves the numbers that a run asked for, and hands them back as `known`.
"""

from collections.abc import Iterator, Mapping, Sequence
import hashlib

import numpy as np
from scipy.special import ndtr


class Tape:
    """Standard normal numbers by key, drawn when first asked for.

    Attributes:
        numbers: All that were asked for or known, by key.
    """

    def __init__(
        self, seed: Sequence[int], known: Mapping[str, float] | None = None
    ) -> None:
        """Begins with what is known.

        Args:
            seed: Of the campaign, and what tells this run from others.
            known: Numbers that are not drawn.
        """
        self._seed, self._before = list(seed), ""
        self.numbers: dict[str, float] = dict(known or {})

    @property
    def run(self) -> int:
        """Number of the run."""
        return self._seed[-1]

    def under(self, name: str) -> "Tape":
        """The same tape, its keys below a name."""
        below = Tape(self._seed)
        below.numbers, below._before = self.numbers, f"{self._before}{name}."
        return below

    def normal(self, key: str) -> float:
        """The number of a key."""
        key = self._before + key
        if key not in self.numbers:
            digest = hashlib.sha256(key.encode()).digest()
            words = np.frombuffer(digest[:16], dtype="<u4").tolist()
            rng = np.random.default_rng([*self._seed, *words])
            self.numbers[key] = float(rng.standard_normal())
        return self.numbers[key]

    def share(self, key: str) -> float:
        """A number even over [0, 1]."""
        return float(ndtr(self.normal(key)))

    def uniform(self, key: str, low: float, high: float) -> float:
        """A number even over an interval."""
        return low + (high - low) * self.share(key)

    def whole(self, key: str, count: int) -> int:
        """One of 0 to count - 1, each alike."""
        return min(int(count * self.share(key)), count - 1)

    def tries(self, name: str, most: int) -> Iterator["Tape"]:
        """A tape for one try after another, until what is drawn can be used."""
        return (self.under(f"{name}.{number}") for number in range(most))
