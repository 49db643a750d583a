"""What a scan costs until the command, with twenty things in sight that move.

Processor time, for the machine may be shared. The scan itself is the plant's.
"""

from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from math import cos, pi, sin
import statistics
from time import process_time
from typing import Any
from unittest.mock import patch

from tests.benchmarks import sensed
from tests.benchmarks.navigation_loop import Now
from tests.benchmarks.navigation_scenes import Frame, Scene, in_hall
from tests.benchmarks.navigators import switching
from tests.benchmarks.sensed import Sensed, Senses

PARTS = {
    "place and grid": ("mapped", "place_now"),
    "tracks": ("walking", "tracked"),
    "what is told": ("sight", "corners"),
}
"""Functions of `sensed`."""
COUNT, SPEED = 20, 0.3


def ring(k: int) -> Frame:
    """Discs that walk about a robot which goes straight, at the k-th scan."""
    discs = []
    for n in range(COUNT):
        angle, away = 2.0 * pi * n / COUNT + 0.02 * k, 1.7 + 0.8 * (n % 2)
        x, y = away * cos(angle), away * sin(angle)
        discs.append((x + 0.1 * SPEED * k - 3.0, y, 0.12, SPEED - 0.2 * y, 0.2 * x))
    return discs


def costs(seed: int, scans: int) -> tuple[list[dict[str, float]], float]:
    """Seconds of the parts of every scan, and how many walkers the planner is told."""
    scene = in_hall(Scene("ring", (-3.0, 0.0), (9.0, 0.0), ring, dt=0.1))
    eyes, step = Sensed(scene, Senses(), seed), switching(scene)
    spent: dict[str, float] = defaultdict(float)

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def act(*values: Any) -> Any:
            start = process_time()
            given = function(*values)
            spent[part] += process_time() - start
            return given

        return act

    rows, tracked = [], []
    with ExitStack() as stack:
        for part, names in PARTS.items():
            for name in names:
                act = timed(part, getattr(sensed, name))
                stack.enter_context(patch.object(sensed, name, act))
        for k in range(scans):
            spent.clear()
            pose = (0.1 * SPEED * k - 3.0, 0.0, 0.0)
            place, seen, corners = eyes.at(pose, (SPEED, 0.0), ring(k), 0.1 * k)
            timed("planner", step)(Now(*place, SPEED, 0.0, seen, corners))
            tracked.append(sum(one.track < 1000.0 for one in seen))
            rows.append(dict(spent))
    begin = len(rows) // 4  # kernels are there, and so are the tracks
    return rows[begin:], statistics.median(tracked[begin:])


def report(seed: int, scenes: int) -> str:
    """The parts' costs over as many scans as scenes are asked for, at least twenty.

    The quickest tenth is what they cost on a machine that does nothing else.
    """
    rows, told = costs(seed, max(min(scenes, 200), 20))
    for row in rows:
        row["all"] = sum(row.values())
    lines = [f"  {told:.0f} walkers are told    median  quickest tenth"]
    for part in rows[0]:
        walls = sorted(1e6 * row[part] for row in rows)
        median, tenth = walls[len(walls) // 2], walls[len(walls) // 10]
        lines.append(f"  {part:<20}{median:>9.0f}{tenth:>13.0f} us")
    return "\n".join(lines)
