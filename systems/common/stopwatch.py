"""Where the controllers' wall time goes: one row for every call into a block."""

from collections import defaultdict
import statistics
from time import perf_counter


class Stopwatch:
    """Collects the wall time of block updates and outputs.

    A call that pulls other blocks' outputs contains their work, so only the
    outermost call is counted: the rows of one instant add up to the work of
    all blocks, whoever asked first. It only observes: nothing a block computes
    depends on it.

    It can look away: to look costs a tenth of a run's time.

    Attributes:
        rows: (block name, simulated time in s, wall time in s, whether it was an
            update), in call order.
        running: Whether a call is being timed, or none is to be.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[str, float, float, bool]] = []
        self.running = False
        self._start, self._after = 0.0, -1.0

    def reset(self) -> None:
        """Forgets all rows."""
        self.rows = []
        self.running, self._after = False, -1.0

    def look(self, whether: bool, time: float) -> None:
        """Looks at what comes after a simulated time in s, or looks away from it.

        An instant that has begun before is not counted: a part of it is over.
        """
        self.running, self._after = not whether, time

    def begin(self) -> bool:
        """Starts a call; False if it is inside another one."""
        if self.running:
            return False
        self.running = True
        self._start = perf_counter()
        return True

    def end(self, name: str, time: float, is_update: bool = False) -> None:
        """Ends the outermost call of block `name` at simulated `time`."""
        wall = perf_counter() - self._start
        if time > self._after:
            self.rows.append((name, time, wall, is_update))
        self.running = False

    def whole_instants(self, controller: str) -> list[float]:
        """Wall time in s of all blocks at each instant `controller` updated in."""
        total: dict[float, float] = defaultdict(float)
        whole: set[float] = set()
        for name, time, wall, is_update in self.rows:
            total[time] += wall
            if is_update and name == controller:
                whole.add(time)
        return [wall for time, wall in total.items() if time in whole]

    def per_block(self) -> dict[str, float]:
        """Median wall time in s of a block's outermost calls in one instant."""
        walls: dict[str, dict[float, float]] = defaultdict(lambda: defaultdict(float))
        for name, time, wall, _ in self.rows:
            walls[name][time] += wall
        return {name: statistics.median(w.values()) for name, w in walls.items()}


STOPWATCH = Stopwatch()
"""The process's one stopwatch; a run resets it when it begins."""
