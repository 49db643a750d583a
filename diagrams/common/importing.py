"""`trocar import`: other people's recordings become the project's own files.

A tip's motion becomes a CSV for `obstacle.recording`, a respiration signal one for
`wall_motion.curve`, and a filmed crowd a scenario of the navigation.
"""

import argparse
from dataclasses import asdict
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from diagrams.common.scenario import ScenarioError
from plants.abdomen.breathing_curve import read_unitless
from plants.crowd.obstacle_motion import ObstacleParams
from plants.crowd.recorded_crowd import load_obsmat
from plants.surgeon.foreign import READERS, placed, summary
from plants.surgeon.recording import save_recording
from systems.common.archive import whole

KINDS = (*READERS, "breathing", "crowd")
AROUND = 2.0
"""Between a crowd and where the robot starts and goes, in m."""


def import_file(arguments: argparse.Namespace) -> None:
    """Runs `trocar import`.

    Raises:
        ScenarioError: If the file is not of its kind.
    """
    ending = ".yaml" if arguments.kind == "crowd" else ".csv"
    out: Path = arguments.out or Path("out") / f"{arguments.file.stem}{ending}"
    try:
        text, told, use = made(arguments)
        out.parent.mkdir(parents=True, exist_ok=True)
        with whole(out) as draft:
            if isinstance(text, str):
                draft.write_text(text, encoding="utf-8")
            else:
                save_recording(draft, *text)
    except (OSError, ValueError, IndexError) as error:
        reason = " ".join(str(error).split())[:300]
        raise ScenarioError(
            f"{str(arguments.file)!r} as {arguments.kind}: {reason}"
        ) from error
    print(told)
    print(use.replace("OUT", str(out)))


def made(arguments: argparse.Namespace) -> tuple[Any, str, str]:
    """What is written, what it holds, and how it is used."""
    if arguments.kind == "crowd":
        people = load_obsmat(arguments.file, arguments.start, arguments.duration)
        text = yaml.safe_dump(crowd_scenario(people, arguments), sort_keys=False)
        return text, f"{len(people)} people", "trocar run OUT"
    if arguments.kind == "breathing":
        curve = read_unitless(arguments.file, arguments.arm, arguments.rate)
        lines = [f"{t:.4f},{b:.4f}" for t, b in curve]
        told = f"{len(curve)} samples over {curve[-1, 0]:.1f} s, {rate_of(curve):.1f} "
        use = "--set wall_motion.curve=OUT --set wall_motion.breathing=[0.005,0,0.008]"
        return "\n".join(["t,b", *lines, ""]), told + "breaths a minute", use
    place = [float(part) for part in arguments.place.split(",")]
    if len(place) != 3 or not all(map(math.isfinite, [*place, arguments.yaw])):
        raise ScenarioError(f"--place {arguments.place}: expected three numbers")
    names = {"arm": arguments.arm} if arguments.arm else {}
    motion = READERS[arguments.kind](arguments.file, **names)
    motion = placed(motion, place, math.radians(arguments.yaw))
    use = "--set obstacle.recording=OUT"
    if motion.gaps:
        gaps = ", ".join(f"{{start: {a:.3f}, end: {b:.3f}}}" for a, b in motion.gaps)
        use += f' --set "tracker.losses=[{gaps}]"'
    return (motion.times, motion.points), summary(motion), use


def rate_of(curve: np.ndarray) -> float:
    """Breaths a minute of a curve (n, 2): how often it rises through its middle."""
    t, b = curve.T
    smooth = np.convolve(b, np.ones(9) / 9.0, "same")
    rises = t[1:][(smooth[:-1] < 0.0) & (smooth[1:] >= 0.0)]
    return 60.0 * (len(rises) - 1) / float(np.ptp(rises)) if len(rises) > 1 else 0.0


def crowd_scenario(
    people: list[ObstacleParams], arguments: argparse.Namespace
) -> dict[str, Any]:
    """A scenario in which the robot crosses a filmed crowd along x."""
    ways = np.concatenate([person.points for person in people])
    (left, _), (right, _) = ways.min(axis=0), ways.max(axis=0)
    middle = float(np.median(ways[:, 1]))
    keys = ("motion", "radius", "times", "points")
    return {
        "system": "navigation",
        "description": f"A filmed crowd of {len(people)}, from {arguments.start} s on",
        "duration": arguments.duration,
        "seed": 1,
        "start": [round(float(left) - AROUND, 3), round(middle, 3)],
        "goal": [round(float(right) + AROUND, 3), round(middle, 3)],
        "obstacles": [{key: asdict(p)[key] for key in keys} for p in people],
    }
