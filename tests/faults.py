"""Runs in which something fails: what the wall feels of it, and how it ends.

`python -m tests.faults --runs 1000` draws so many faults at random times from the
seeds 1001 and on, a row of the table after the other (`--only ROW` for one), and prints
for each the worst of its runs.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
import random

import numpy as np

from diagrams.common.run import Run, simulate
from diagrams.studies import load_scenario

LIMIT = 5.0
"""Force on the wall that a robot must not keep up [N]."""
AFTER = 2.0
"""How long after a fault its effect counts as the fault's [s]."""
FIRST_SEED = 1001

type Faults = Callable[[random.Random], list[str]]


@dataclass
class Row:
    """A row of the table.

    Attributes:
        scenario: What is run.
        overrides: Of its keys, drawn at random; the first one has the fault.
        most: Force on the wall at the most [N].
        lasting: Longest time over the limit [s].
    """

    scenario: str
    overrides: Faults
    most: float = 8.0
    lasting: float = 0.3


def fault(
    kind: str, low: float, high: float, duration: float, size: float = 0.0
) -> Faults:
    """Overrides with one fault, its start drawn between two times."""

    def drawn(rng: random.Random) -> list[str]:
        start = round(rng.uniform(low, high), 3)
        told = f"kind: {kind}, start: {start}, duration: {duration}, size: {size}"
        return [f"faults=[{{{told}}}]"]

    return drawn


def jump(rng: random.Random) -> list[str]:
    """The wall jumps 30 mm to any side."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    x, y = 0.03 * np.cos(angle), 0.03 * np.sin(angle)
    start = rng.uniform(4.0, 6.0)
    return [f"wall_motion.step=[{x},{y},0]", f"wall_motion.step_time={start}"]


def moved(rng: random.Random) -> list[str]:
    """The wall moves 30 mm to any side within 0.3 s."""
    return [*jump(rng), "wall_motion.step_duration=0.3"]


def also(faults: Faults, *more: str) -> Faults:
    """The overrides, and more of them."""
    return lambda rng: [*faults(rng), *more]


ARCS, GAUZE, BREATH = "pwe_arc_breathing", "gauze_dynamic", "gauze_breathing"
SHORT = ("compare=[]", "duration=18")
SAMPLE = 1 / 120
ROWS = {
    "no fault, hunted": Row("gauze_hunted", lambda rng: ["time_ratio=false"], 3.0, 0.0),
    "frame in the future": Row(GAUZE, fault("frame_future", 0.5, 3.0, 0.02, 100.0)),
    "force stuck": Row(ARCS, also(fault("force_stuck", 6, 12, 4), *SHORT)),
    "force flipped": Row(ARCS, also(fault("force_flipped", 6, 12, 4), *SHORT)),
    "force +20 N": Row(ARCS, also(fault("force_bias", 6, 12, 4, 20), *SHORT)),
    "force +6 N": Row(ARCS, also(fault("force_bias", 6, 12, 4, 6), *SHORT)),
    "force 1e8 N once": Row(
        ARCS, also(fault("force_bias", 6, 12, SAMPLE, 1e8), *SHORT)
    ),
    "force silent": Row(ARCS, also(fault("force_silent", 6, 12, 4), *SHORT)),
    "silent, known": Row(
        ARCS, also(fault("force_silent", 6, 12, 4), *SHORT, "wrist=known")
    ),
    "estimate NaN": Row(ARCS, also(fault("estimate_nan", 6, 12, 1), *SHORT)),
    "estimates NaN, gauze": Row(BREATH, fault("estimate_nan", 2, 6, 1)),
    "arm 0.01 rad/s": Row(ARCS, also(fault("arm_slow", 6, 12, 4, 0.01), *SHORT)),
    "arm slow, gauze": Row(GAUZE, fault("arm_slow", 0.5, 3, 4, 0.01)),
    "arm slow, known": Row(
        ARCS, also(fault("arm_slow", 6, 12, 4, 0.01), *SHORT, "wrist=known")
    ),
    # 15 N of the spring and what its damper adds, before anything can move.
    "wall jumps 30 mm": Row("pwe_step", jump, 25.0, 0.3),
    "wall moves 30 mm": Row("pwe_step", moved, 10.0, 0.3),
    "tension NaN": Row(
        "snake_circle", also(fault("tension_nan", 1, 3, 1), "duration=5")
    ),
}


@dataclass
class Outcome:
    """What became of a run.

    Attributes:
        seed: Of the run.
        force: Largest on the wall [N].
        over: Longest time in a row over `LIMIT` [s].
        late: Mean force over the last two seconds [N].
        stopped: Whether the robot stood at some time for a reason.
        ended: Whether the run came to its end, all numbers finite.
        touched: Whether tools touched.
    """

    seed: int
    force: float
    over: float
    late: float
    stopped: bool
    ended: bool
    touched: bool


def longest(time: np.ndarray, flags: np.ndarray) -> float:
    """The longest time in a row in which the flags are set [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    spans = edges.reshape(-1, 2)
    return max((float(time[b - 1] - time[a]) for a, b in spans), default=0.0)


def outcome(run: Run) -> Outcome:
    """What became of a run."""
    seed, ended = run.scenario.seed, not run.error
    if run.scenario.system == "snake":
        stopped = run.watch.alarm.time[-1] >= 0.0
        return Outcome(seed, 0.0, 0.0, 0.0, bool(stopped), ended, False)
    time = run.signals["time"]
    force = np.linalg.norm(run.wall.force.f, axis=1)
    if run.scenario.faults:  # what a wrong first guess costs before is no fault's
        force[time < run.scenario.faults[0].start] = 0.0
    stops = bool(run.metrics.get("stops"))
    if "wrist.permission.code" in run.signals:
        codes = np.round(run.wrist.permission.code)
        stops = stops or bool(((codes > 0) & (codes != 10)).any())
    return Outcome(
        seed,
        float(force.max()),
        longest(time, force > LIMIT),
        float(force[time > time[-1] - 2.0].mean()),
        stops,
        ended,
        bool(run.metrics.get("contact", False)),
    )


def ran(row: Row, seed: int) -> Outcome:
    """Runs a row's scenario with a fault that the seed draws."""
    overrides = row.overrides(random.Random(seed))
    return outcome(simulate(load_scenario(row.scenario, overrides, seed)))


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--only", choices=ROWS, metavar="ROW")
    arguments = parser.parse_args()
    rows = {k: v for k, v in ROWS.items() if arguments.only in (None, k)}
    for name, row in rows.items():
        seeds = range(FIRST_SEED, FIRST_SEED + max(1, arguments.runs // len(rows)))
        found = [ran(row, seed) for seed in seeds]
        bad = [o.seed for o in found if not good(row, o)]
        print(
            f"{name:22} {len(found):4} runs  "
            f"most {max(o.force for o in found):6.2f} N  "
            f"over {LIMIT:g} N {max(o.over for o in found):5.2f} s  "
            f"last {max(o.late for o in found):5.2f} N  "
            f"stopped {sum(o.stopped for o in found):4}  "
            f"touched {sum(o.touched for o in found):3}  "
            f"broken {sum(not o.ended for o in found):3}  bad {len(bad)} {bad[:5]}",
            flush=True,
        )


def good(row: Row, outcome: Outcome) -> bool:
    """Whether a run is as the table asks."""
    calm = outcome.force <= row.most and outcome.over <= row.lasting
    return calm and outcome.ended and not outcome.touched


if __name__ == "__main__":
    main()
