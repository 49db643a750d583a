"""The local planner in random scenes: reached, contact, stuck.

`python -m tests.benchmarks.kinematic_scenes --scenes 300 --seed 1` prints a table
for the corrected and the printed form of the paper's method, standing and moving
obstacle. The figures are what they are: the method has local minima.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
import statistics
import time

from systems.auto_guidance.backward_movement import BackwardMovementParams
from systems.auto_guidance.go_to_target import GoToTargetParams
from tests.benchmarks.crossed_scenes import KINDS, scene
from tests.benchmarks.kinematic_loop import LocalPlanner, Outcome, Planner, run


def corrected() -> Planner:
    """The blocks as they are by default."""
    return LocalPlanner()


def printed() -> Planner:
    """The printed equations (2), (4) and (5)."""
    return LocalPlanner(
        go=GoToTargetParams(form="printed"),
        backward=BackwardMovementParams(form="printed"),
    )


def field_only() -> Planner:
    """The corrected potential field alone, v_1."""
    return LocalPlanner(field_only=True)


PLANNERS: dict[str, Callable[[], Planner]] = {
    "corrected": corrected,
    "printed": printed,
    "field only": field_only,
}


@dataclass
class Tally:
    """Counts over a set of scenes.

    Attributes:
        outcomes: One per scene, in the scenes' order.
    """

    outcomes: list[Outcome]

    def share(self, what: str) -> float:
        """Share of "reached", "contact" or "stuck" (neither), in [0, 1]."""
        n = len(self.outcomes)
        reached = sum(o.reached for o in self.outcomes) / n
        contact = sum(o.contact for o in self.outcomes) / n
        shares = {"reached": reached, "contact": contact}
        return shares.get(what, 1.0 - reached - contact)

    def time(self) -> float:
        """Median time of arrival where reached, s; NaN if never."""
        times = [o.time for o in self.outcomes if o.reached and o.time is not None]
        return statistics.median(times) if times else float("nan")

    def clearance(self) -> float:
        """Median of the scenes' least clearances, m."""
        return statistics.median(o.clearance for o in self.outcomes)


def tally(kind: str, make: Callable[[], Planner], scenes: int, seed: int) -> Tally:
    """Runs a planner through a set of scenes.

    Args:
        kind: "standing" or "moving".
        make: Makes a fresh planner.
        scenes: How many.
        seed: Of the set.
    """
    return Tally([run(scene(kind, seed, k), make()) for k in range(scenes)])


def table(scenes: int, seed: int, names: list[str]) -> str:
    """The table of all kinds of scenes and the named planners, as text."""
    rows = [
        f"{'scenes':10} {'planner':12} {'n':>5} {'reached':>8} {'contact':>8} "
        f"{'stuck':>7} {'time':>7} {'clearance':>10} {'wall':>7}"
    ]
    for kind in KINDS:
        for name in names:
            start = time.perf_counter()
            t = tally(kind, PLANNERS[name], scenes, seed)
            wall = time.perf_counter() - start
            rows.append(
                f"{kind:10} {name:12} {scenes:5d} {t.share('reached'):8.1%} "
                f"{t.share('contact'):8.1%} {t.share('stuck'):7.1%} "
                f"{t.time():5.1f} s {1e3 * t.clearance():7.1f} mm {wall:5.0f} s"
            )
    return "\n".join(rows)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=300, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--planner",
        action="append",
        choices=list(PLANNERS),
        help="may be given several times; all by default",
    )
    args = parser.parse_args()
    if args.scenes < 1:
        parser.error(f"--scenes {args.scenes}: must be at least 1")
    print(table(args.scenes, args.seed, args.planner or list(PLANNERS)))


if __name__ == "__main__":
    main()
