"""Runs that are killed at any instant: what is there is whole, and nothing is lost.

`python -m tests.kills --kills 50` kills a run of each scenario in turn, after a time
drawn between its first second and its last, and looks at what it left:

- no result but a whole one, and none of the run before beside those of this one;
- of a resection all procedures that were committed and all tissue that was gone;
- begun again it ends with the figures of a run that nobody killed.
"""

import argparse
import csv
import json
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from diagrams.common.metrics import WALL_CLOCK

SMALL = ["spacing=0.001", "reach_effort=0.25", "planner.target=0.6"]
CASES: dict[str, tuple[str, list[str]]] = {
    "gauze": ("gauze_static", ["--duration", "4"]),
    "resection": ("resect_auto_small", [f"--set={told}" for told in SMALL]),
}
ENDS = {".html": b"</html>", ".png": b"IEND\xaeB`\x82"}
"""What a whole file ends with."""


def command(case: str, out: Path, session: Path) -> list[str]:
    """The command line of a case."""
    name, more = CASES[case]
    told = [f"--set=session={session}"] if case == "resection" else []
    run = [sys.executable, "-m", "diagrams", "run", name, "--out", str(out)]
    return [*run, *more, *told]


RESUMED = {
    *("duration", "execution_time", "max_tool_error", "path_length", "resumed_at"),
    *("rms_tool_error", "refusals"),
}
"""Figures of a resection that count from where it went on."""


def steady(metrics: dict[str, Any]) -> dict[str, Any]:
    """The figures that are the same whether a run was killed before or not."""
    return {k: v for k, v in metrics.items() if k not in WALL_CLOCK | RESUMED}


def newer(path: Path, other: Path) -> bool:
    """Whether a file was written after another."""
    return path.stat().st_mtime_ns > other.stat().st_mtime_ns


def faults_of(out: Path) -> list[str]:
    """What is wrong with the results in a folder."""
    found = []
    for path in out.rglob("*"):
        if path.is_file() and path.name.endswith(".draft"):
            continue  # it never had a result's name
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif ENDS.get(path.suffix, b"") not in path.read_bytes()[-2000:]:
            found.append(f"{path.name} is cut off")
        elif path.name == "signals.csv":
            rows = list(csv.reader(path.open()))
            if len({len(row) for row in rows}) != 1:
                found.append("signals.csv is cut off")
    told = out / "scenario.yaml"  # a run writes it first
    others = [out / "metrics.json", *out.glob("*.html"), *out.glob("*.png")]
    for path in others:
        if path.exists() and not (told.exists() and newer(path, told)):
            found.append(f"{path.name} is of the run before")
    return found


def killed(arguments: list[str], after: float) -> bool:
    """Runs a command and kills it after a time in s; whether it was still there."""
    process = subprocess.Popen(
        arguments,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return True
    return False


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    arguments = parser.parse_args()
    dice, wrong, kills = random.Random(1), [], dict.fromkeys(CASES, 0)
    with tempfile.TemporaryDirectory() as folder:
        home, whole, length = Path(folder), {}, {}
        for case in CASES:
            began = time.perf_counter()
            out = home / f"{case}.whole"
            subprocess.run(command(case, out, home / f"{case}.s"), check=True)
            length[case] = time.perf_counter() - began
            whole[case] = steady(json.loads((out / "metrics.json").read_text()))
        while sum(kills.values()) < arguments.kills:
            case = min(kills, key=lambda name: kills[name])
            out, session = home / case, home / f"{case}.{kills[case] // 5}.session"
            # A folder holds another seed's run before, and a session goes on.
            seed = 1 if case == "resection" else 1 + kills[case] % 2
            told = [*command(case, out, session), "--seed", str(seed)]
            if not killed(told, dice.uniform(1.0, length[case])):
                continue
            kills[case] += 1
            if out.is_dir():
                wrong += [f"{case}: {text}" for text in faults_of(out)]
            if kills[case] % 5 == 0:
                subprocess.run([*told[:-1], "1"], check=True, capture_output=True)
                end = steady(json.loads((out / "metrics.json").read_text()))
                if end != whole[case]:
                    keys = [key for key in end if end[key] != whole[case].get(key)]
                    wrong.append(f"{case}: figures differ: {', '.join(keys)}")
            print(f"{sum(kills.values())} killed, wrong: {wrong}", flush=True)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
