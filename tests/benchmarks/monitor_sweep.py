"""The navigation monitor: how soon it notices what is named, and its false alarms.

A fault begins between 8 and 12 s and lasts 4 s; its time and side, and the breath's
rate and phase, are the seed's. A fault is noticed when the monitor finds a doubt while
it lasts or half a second later; an alarm is false when there is no fault yet, or none
at all, and the shaft goes through the true fulcrum to a millimetre from half a second
before to half a second after. "Unsaid" is the time in which it is farther off and the
navigation is said to be accurate.
"""

from collections.abc import Callable
from dataclasses import dataclass
import random
import statistics

import numpy as np

from diagrams.campaigns.statistics import share_interval, upper_bound
from diagrams.common.run import Run, simulate
from diagrams.studies import load_scenario
from systems.passive_wrist.navigation_monitor import Doubt

LASTS, AFTER = 4.0, 0.5
OFF = 1e-3
ARCS, GAUZE = "pwe_arc_breathing", "gauze_breathing"
SHORT = {ARCS: ["compare=[]", "duration=18"], GAUZE: ["duration=16"]}
CLEAN = (ARCS, GAUZE, "gauze_breathing_real", "gauze_press", "pwe_insufflation")

type Fault = Callable[[random.Random, float], list[str]]


def wire(kind: str, size: float = 0.0) -> Fault:
    """A fault of a wire."""
    told = f"kind: {kind}, duration: {LASTS}, size: {size}"
    return lambda rng, start: [f"faults=[{{{told}, start: {start}}}]"]


def wall(key: str, size: float, *more: str) -> Fault:
    """The fulcrum goes to any side, at once (`step`) or in a while (`rise`)."""

    def drawn(rng: random.Random, start: float) -> list[str]:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        to = f"[{size * np.cos(angle):.5f},{size * np.sin(angle):.5f},0]"
        moved = [f"wall_motion.{key}={to}", f"wall_motion.{key}_time={start}"]
        return [*moved, *more]

    return drawn


FAULTS = {
    "wall jumps 10 mm": wall("step", 0.01),
    "fulcrum moves 10 mm in 1 s": wall("rise", 0.01, "wall_motion.rise_duration=1"),
    "force + 0.3 N": wire("force_bias", 0.3),
    "force + 1 N": wire("force_bias", 1.0),
    "force + 6 N": wire("force_bias", 6.0),
    "force of the other sign": wire("force_flipped"),
    "force stuck": wire("force_stuck"),
    "sensor silent": wire("force_silent"),
    "estimate 5 mm aside": wire("fulcrum_aside", 0.005),
    "estimate 5 mm deep": wire("fulcrum_deep", 0.005),
    "arm at 0.01 rad/s": wire("arm_slow", 0.01),
}
IN_GAUZE = (
    *("wall jumps 10 mm", "force + 1 N", "estimate 5 mm aside", "estimate 5 mm deep"),
)
"""Those that are tried while gauze is carried as well."""


@dataclass
class Watched:
    """What the monitor said in a run.

    Attributes:
        delay: From the fault's start in s; None if not noticed, or without one.
        false: Alarms without a fault.
        clean: Time without one, s.
        unsaid: See the module, s.
        most: How far the shaft was off at the most, m.
    """

    delay: float | None
    false: int
    clean: float
    unsaid: float
    most: float


def near(time: np.ndarray, instant: float) -> np.ndarray:
    """Which samples are no more than `AFTER` from an instant."""
    return np.abs(time - instant) <= AFTER


def watched(run: Run, start: float) -> Watched:
    """Judges a run whose fault begins at a time, infinity without one."""
    time, told = run.signals["time"], run.wrist.accuracy
    doubts = np.round(told.doubt) > Doubt.PROBING
    off = run.wall.fulcrum_error.distance
    during = (time >= start) & (time <= start + LASTS + AFTER)
    first = time[during & doubts & (told.alarms > 0)]
    alarms = time[1:][np.diff(told.alarms) > 0]
    before = time < start
    probed = np.round(told.doubt) == Doubt.PROBING
    late = time > time[probed].max(initial=0.0)
    period = time[1] - time[0]
    return Watched(
        float(first[0] - start) if len(first) else None,
        len([t for t in alarms[alarms < start] if off[near(time, t)].max() <= OFF]),
        float(period * np.sum(before & late)),
        float(period * np.sum(late & (off > OFF) & (told.accurate > 0.5))),
        float(off[during & late].max(initial=0.0)),
    )


def ran(scenario: str, fault: str, seed: int) -> Watched:
    """A run of a scenario with a fault of `FAULTS`, or without one."""
    rng = random.Random(seed)
    start = round(rng.uniform(8.0, 12.0), 3)
    more = [*SHORT.get(scenario, [])]
    if scenario in SHORT:
        more.append(f"wall_motion.rate={rng.uniform(0.15, 0.4):.3f}")
        more.append(f"wall_motion.phase={rng.uniform(0.0, 1.0):.3f}")
    if fault:
        more += FAULTS[fault](rng, start)
    run = simulate(load_scenario(scenario, more, seed))
    return watched(run, start if fault else np.inf)


def row(scenario: str, fault: str, seeds: range) -> tuple[str, list[Watched]]:
    """A line of the table."""
    found = [ran(scenario, fault, seed) for seed in seeds]
    n, false = len(found), sum(one.false for one in found)
    unsaid = [one.unsaid for one in found]
    said = f"false {false}, unsaid {max(unsaid):.2f} s at the most"
    if not fault:
        return f"{scenario:22} {n} runs, {said}", found
    delays = [one.delay for one in found if one.delay is not None]
    times = "-"
    if delays:
        middle = statistics.median(delays)
        times = f"{middle:.3f} ({min(delays):.3f}-{max(delays):.3f}) s"
    least = share_interval(len(delays), n)[0]
    most = 1e3 * statistics.median(one.most for one in found)
    line = (
        f"{scenario:18} {fault:27} noticed {len(delays)} of {n} (at least {least:.3f}) "
        f"after {times}, off {most:.1f} mm at the most (median), {said}"
    )
    return line, found


def report(seed: int, scenes: int) -> str:
    """The table, as text; a fifteenth of `scenes` in each row."""
    seeds = range(seed, seed + max(1, scenes // 15))
    cases = [(ARCS, name) for name in FAULTS] + [(GAUZE, name) for name in IN_GAUZE]
    cases += [(name, "") for name in CLEAN]
    lines, without, before = [], [], []
    for scenario, fault in cases:
        line, found = row(scenario, fault, seeds)
        print(line, flush=True)
        lines.append(line)
        (before if fault else without).extend(found)
    for name, found in (("clean", without), ("before a fault", before)):
        bad, n = sum(one.false > 0 for one in found), len(found)
        minutes = sum(one.clean for one in found) / 60.0
        lines.append(
            f"{name}: a false alarm in {bad} of {n} runs, {minutes:.1f} minutes: at "
            f"most {upper_bound(bad, n):.4f} of the runs (95 %, exact)"
        )
    return "\n".join(lines[-2:])
