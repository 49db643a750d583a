"""The local planner in random scenes: reached, contact, stuck.

The corrected and the printed form of the paper's method, standing and moving obstacle,
and the corrected one with Table I read to the letter on v_R (Figure 4) and on v_1.
The figures are what they are: the method has local minima.
"""

from collections.abc import Callable
from dataclasses import dataclass
import statistics
import time

from diagrams.gauze.kinematic_loop import Outcome, Planner, run
from diagrams.gauze.kinematic_planners import PLANNERS
from diagrams.gauze.scenes import scene

CHOSEN = (
    *("corrected field", "literal on v_R", "literal on v_1", "printed field"),
    "field only",
)


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

    def arrived(self) -> float:
        """Share that came within 1 mm of the target, if only in passing."""
        return sum(o.time is not None for o in self.outcomes) / len(self.outcomes)

    def contacts_at_fulcrum(self) -> float:
        """Share with contact on O's first tenth, next to its fulcrum.

        There the conical gain (3) takes the repulsion away.
        """
        hits = sum(o.contact and o.fraction < 0.1 for o in self.outcomes)
        return hits / len(self.outcomes)

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


def report(seed: int, scenes: int) -> str:
    """The table of both kinds of scenes and the planners, as text.

    "passed by" counts the scenes in which the tip came within 1 mm of the target at
    all, "reached" those where it came to rest there without contact. The time is the
    median of the first arrival where reached, the clearance the median of the least.
    """
    rows = [
        f"{'scenes':9} {'planner':15} {'n':>5} {'reached':>8} {'contact':>8} "
        f"{'(at G_O)':>8} {'stuck':>7} {'passed by':>9} {'time':>6} "
        f"{'clearance':>9} {'wall':>6}"
    ]
    for kind in ("standing", "moving"):
        for name in CHOSEN:
            start = time.perf_counter()
            t = tally(kind, PLANNERS[name], scenes, seed)
            wall = time.perf_counter() - start
            rows.append(
                f"{kind:9} {name:15} {scenes:5d} {t.share('reached'):8.1%} "
                f"{t.share('contact'):8.1%} {t.contacts_at_fulcrum():8.1%} "
                f"{t.share('stuck'):7.1%} {t.arrived():9.1%} {t.time():4.1f} s "
                f"{1e3 * t.clearance():6.1f} mm {wall:4.0f} s"
            )
    return "\n".join(rows)
