"""Where the controllers' wall time goes: one row for every update of a block."""

from collections import defaultdict
import statistics


class Stopwatch:
    """Collects the wall time of block updates.

    It only observes: nothing a block computes depends on it.

    Attributes:
        rows: (block name, simulated time in s, wall time in s), in call order.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[str, float, float]] = []

    def reset(self) -> None:
        """Forgets all rows."""
        self.rows = []

    def per_instant(self) -> dict[float, float]:
        """Wall time in s of all blocks together, by control instant."""
        total: dict[float, float] = defaultdict(float)
        for _, time, wall in self.rows:
            total[time] += wall
        return dict(total)

    def per_block(self) -> dict[str, float]:
        """Median wall time in s of one update, by block.

        An update that pulls other blocks' outputs is charged with their work.
        """
        walls: dict[str, list[float]] = defaultdict(list)
        for name, _, wall in self.rows:
            walls[name].append(wall)
        return {name: statistics.median(w) for name, w in walls.items()}


STOPWATCH = Stopwatch()
"""The process's one stopwatch; `diagrams.common.run` resets it before a run."""
