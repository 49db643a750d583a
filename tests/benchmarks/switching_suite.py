"""Switching potentials and their peers, in the same worlds.

Each suite is run on its fixed seed and on a held-out one. Peers come with
`pip install -e '.[peers]'`; without them our own planners run alone.
"""

from collections.abc import Iterator, Sequence
import statistics

from tests.benchmarks.navigation_loop import Planner, Result, run
from tests.benchmarks.navigation_scenes import SUITES, Scene
from tests.benchmarks.navigators import planners

FIXED = 0
"""Seed of the fixed worlds."""
FULL = 300
"""From this number of scenes on, a suite is as large as it is."""
HEADER = (
    "planner",
    "success",
    "collision",
    "timeout",
    "clearance m",
    "path ratio",
    "time s",
    "us/step",
    "p99",
)


def tally(results: Sequence[Result]) -> list[str]:
    """One row of the table: rates, then medians over the successes."""
    n = len(results)
    reached = [r for r in results if r.outcome == "reached"]
    row = [
        f"{sum(r.outcome == outcome for r in results) / n:.3f}"
        for outcome in ("reached", "collided", "timeout")
    ]
    if reached:
        row += [
            f"{statistics.median(r.clearance for r in reached):.3f}",
            f"{statistics.median(r.ratio for r in reached):.2f}",
            f"{statistics.median(r.time for r in reached):.1f}",
        ]
    else:
        row += ["-"] * 3
    walls = sorted(wall for r in results for wall in r.walls)
    return [
        *row,
        f"{1e6 * statistics.median(walls):.1f}",
        f"{1e6 * walls[int(0.99 * len(walls))]:.0f}",
    ]


def evaluate(scenes: Sequence[Scene], planner: Planner) -> list[Result]:
    """Runs a planner through scenes."""
    return [run(scene, planner) for scene in scenes]


def table(title: str, scenes: Sequence[Scene], chosen: dict[str, Planner]) -> str:
    """The table of one suite."""
    lines = [f"\n{title} ({len(scenes)} scenes)"]
    form = "{:<18}" + "{:>12}" * (len(HEADER) - 1)
    lines.append(form.format(*HEADER))
    for name, planner in chosen.items():
        results = evaluate(scenes, planner)
        lines.append(form.format(name, *tally(results)))
        if len(scenes) <= 6:
            failed = [
                f"{scene.name}: {result.outcome}"
                for scene, result in zip(scenes, results, strict=True)
                if result.outcome != "reached"
            ]
            lines.append(f"  {', '.join(failed) or 'all reached'}")
    return "\n".join(lines)


def report(seed: int, scenes: int, suites: Sequence[str] = ()) -> str:
    """Runs the suites on fixed and held-out worlds.

    Args:
        seed: Names the held-out worlds.
        scenes: How many of each suite; all from 300 on.
        suites: Names of suites; all by default.
    """
    return "\n".join(tables(seed, scenes, suites))


def tables(seed: int, scenes: int, suites: Sequence[str] = ()) -> Iterator[str]:
    """The tables of `report`, each as soon as it is there."""
    chosen = planners()
    count = {} if scenes >= FULL else {"count": scenes}
    for name in suites or SUITES:
        make = SUITES[name]
        yield table(f"{name}, fixed seed", make(FIXED, **count), chosen)
        if name != "classics":
            held_out = make(100 + seed, **count)
            yield table(f"{name}, held-out seed {seed}", held_out, chosen)
