"""Motions that others recorded: da Vinci tables and joints, tracker sequences.

None has W's frame: `placed` brings a motion into the scene.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
import io
import math
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from plants.surgeon.psm import psm_tip
from plants.surgeon.recording import load_recording
from systems.common.archive import read_regular

LARGEST = 256_000_000
"""Of a file, in bytes."""

DA_VINCI_RATE = 30.0
"""Samples a second of da Vinci recordings, which have no times."""

ARMS = ("master_left", "master_right", "slave_left", "slave_right")
"""In the order of a JIGSAWS table's columns, each with `ARM_COLUMNS`."""

ARM_COLUMNS = 19
"""Tip (3), rotation (9), velocities (6), gripper."""

LOST_AFTER = 2.5
"""Samples missing in a row, in usual intervals, that make a gap."""


@dataclass
class Motion:
    """A tip's motion.

    Attributes:
        times: Since the first sample, in s, rising, shape (n,).
        points: Places of the tip in m, in its own frame or W, shape (n, 3).
        gaps: Begin and end of each time without sight, in s.
    """

    times: NDArray[np.float64]
    points: NDArray[np.float64]
    gaps: list[tuple[float, float]] = field(default_factory=list)


def _numbers(path: Path, columns: int) -> NDArray[np.float64]:
    """The table of a text or .npy file, by white space or commas, a header or none."""
    data = read_regular(path, LARGEST)
    if path.suffix == ".npy":
        table = np.load(io.BytesIO(data), allow_pickle=False)
    else:
        lines = data.decode("utf-8-sig").splitlines()
        rows = [re.split(r"[\s,;]+", line.strip()) for line in lines if line.strip()]
        if rows and not re.fullmatch(r"[-+0-9.eE]+", rows[0][0]):
            rows = rows[1:]
        table = np.array(rows, float)
    if table.ndim != 2 or table.shape[1] != columns or len(table) < 2:
        raise ValueError(f"a table {table.shape}: expected at least 2 x {columns}")
    if not np.isfinite(table).all():
        raise ValueError("a table with numbers that are not finite")
    return np.asarray(table, float)


def jigsaws(path: Path, arm: str = "slave_right") -> Motion:
    """A JIGSAWS table: 76 columns at 30 Hz, four arms, in m.

    Raises:
        ValueError: If it is none, or there is no such arm.
    """
    if arm not in ARMS:
        raise ValueError(f"arm={arm!r}: expected one of {', '.join(ARMS)}")
    table = _numbers(path, ARM_COLUMNS * len(ARMS))
    first = ARM_COLUMNS * ARMS.index(arm)
    times = np.arange(len(table)) / DA_VINCI_RATE
    return Motion(times, table[:, first : first + 3])


def dvrk(path: Path, arm: str = "") -> Motion:
    """Six joints of a patient-side manipulator at 30 Hz, rad and m.

    Raises:
        ValueError: If it is none.
    """
    q = _numbers(path, 6)
    if np.abs(q).max() > 2.0 * math.pi:
        raise ValueError(f"joints up to {np.abs(q).max():.4g}: expected rad and m")
    return Motion(np.arange(len(q)) / DA_VINCI_RATE, psm_tip(q))


FRAME = re.compile(r"Seq_Frame(\d+)_(\w+?)\s*(?::=|=)\s*(.*)")


def plus(path: Path, arm: str = "") -> Motion:
    """A tracker sequence of PLUS, `.igs.mha` or `.igs.nrrd`, in mm: a tool's origin.

    Frames whose status is not OK are left out; several missing in a row are a gap.

    Args:
        path: The file.
        arm: Which transform, e.g. ProbeToTracker; it may be left out if there is one.

    Raises:
        ValueError: If there is no such transform, or it is nowhere valid.
    """
    frames: dict[int, dict[str, str]] = {}
    for raw in read_regular(path, LARGEST).split(b"\n"):
        line = raw.decode("latin-1").strip()
        found = FRAME.match(line)
        if found:
            frames.setdefault(int(found[1]), {})[found[2]] = found[3]
        elif not line or line.startswith("ElementDataFile"):
            break
    ends = "Transform"
    names = {
        key.removesuffix(ends)
        for f in frames.values()
        for key in f
        if key.endswith(ends)
    }
    if not arm and len(names) == 1:
        (arm,) = names
    if arm not in names:
        known = ", ".join(sorted(names)) or "none"
        raise ValueError(f"transform {arm!r}: it has {known}")
    rows = []
    for _, told in sorted(frames.items()):
        is_valid = told.get(f"{arm}{ends}Status", "OK") == "OK"
        if is_valid and "Timestamp" in told and f"{arm}{ends}" in told:
            pose = np.array(told[f"{arm}{ends}"].split(), float).reshape(4, 4)
            rows.append([float(told["Timestamp"]), *(1e-3 * pose[:3, 3])])
    if len(rows) < 2:
        raise ValueError(f"transform {arm!r}: {len(rows)} of {len(frames)} are valid")
    table = np.array(rows)
    times = table[:, 0] - table[0, 0]
    steps = np.diff(times)
    if not (steps > 0.0).all() or not np.isfinite(table).all():
        raise ValueError("timestamps that do not rise, or poses that are not finite")
    long = np.flatnonzero(steps > LOST_AFTER * np.median(steps))
    gaps = [(float(times[k]), float(times[k + 1])) for k in long]
    return Motion(times, table[:, 1:], gaps)


def csv(path: Path, arm: str = "") -> Motion:
    """A recording as `load_recording` takes it, units declared in its header."""
    return Motion(*load_recording(path))


READERS: dict[str, Callable[..., Motion]] = {
    "jigsaws": jigsaws,
    "dvrk": dvrk,
    "plus": plus,
    "csv": csv,
}
"""What can be read, by kind: of a file, and an arm's or a transform's name."""


def placed(motion: Motion, middle: list[float], yaw: float = 0.0) -> Motion:
    """A motion in W: turned about the vertical, its mean at a place.

    Args:
        motion: In its own frame.
        middle: p_W in m, (3,).
        yaw: In rad.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    points = (motion.points - motion.points.mean(axis=0)) @ R.T + middle
    return Motion(motion.times, points, motion.gaps)


def summary(motion: Motion) -> str:
    """Samples, extent and speeds, in a few lines."""
    steps = np.diff(motion.times)
    speed = np.linalg.norm(np.diff(motion.points, axis=0), axis=1) / steps
    low, high = motion.points.min(axis=0), motion.points.max(axis=0)
    extent = " x ".join(f"{1e3 * side:.0f}" for side in high - low)
    mean, usual, most = speed.mean(), np.quantile(speed, 0.95), speed.max()
    lines = [
        f"{len(motion.times)} samples over {motion.times[-1]:.2f} s, "
        f"{1.0 / np.median(steps):.1f} a second",
        f"extent {extent} mm",
        f"speed {1e3 * mean:.1f} mm/s, 95 % below {1e3 * usual:.1f}, "
        f"at most {1e3 * most:.1f}",
    ]
    lost = sum(end - start for start, end in motion.gaps)
    if motion.gaps:
        lines.append(f"{len(motion.gaps)} gaps, {lost:.2f} s without sight")
    return "\n".join(lines)
