"""Pace: what is simulated, kept to the clock on the wall."""

from time import perf_counter

BEHIND = 0.05
"""By which it may lag and catch up; what it is later than that is lost [s]."""


class Pace:
    """Says when it is time; it begins when it is asked first."""

    def __init__(self, speed: float) -> None:
        """Makes a pace of so many simulated seconds a second; 0 for no pace."""
        self._speed, self._begin, self._last = speed, 0.0, float("inf")

    def late(self, time: float) -> float:
        """How late a simulated time in s is, in s of the clock; < 0 if it is early."""
        if self._speed == 0.0:
            return 0.0
        now = perf_counter()
        if time < self._last:  # it begins, perhaps again
            self._begin = now - time / self._speed
        late = now - (self._begin + time / self._speed)
        self._begin += max(late - BEHIND, 0.0)  # or all would be made up for in a rush
        self._last = time
        return late

    def early(self, time: float) -> float:
        """How much too early a simulated time in s is, in s of the clock."""
        return max(-self.late(time), 0.0)
