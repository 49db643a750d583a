"""Recorded motions of a surgeon's tool: reading them, and making synthetic ones.

A recording is a CSV file with the header `t,x,y,z`: time in s and the tool's tip in
the world frame W (z up) in m. A column in another unit is named with it: `t_ms`,
`t_us`, `t_ns`; `x_mm`. Other columns are ignored. Time begins at the first sample.
"""

import codecs
from collections.abc import Sequence
import csv
import io
import math
from pathlib import Path

import numpy as np

from systems.common.archive import read_regular

COLUMNS = ("t", "x", "y", "z")

SWEEP_SEED = 73
SWEEP_VIA = (
    (-0.030, 0.020, -0.100),
    (0.035, -0.010, -0.110),
    (-0.010, -0.020, -0.090),
    (0.030, 0.030, -0.120),
)
"""`synthesize_sweep(SWEEP_SEED, SWEEP_VIA)` is the recording that ships with trocar,
`diagrams/gauze/recordings/obstacle_sweep.csv`: the obstacle tool works to and fro
across the middle of the cavity."""

_TIMES = {"": 1.0, "_s": 1.0, "_ms": 1e-3, "_us": 1e-6, "_ns": 1e-9}
_LENGTHS = {"": 1.0, "_m": 1.0, "_mm": 1e-3}
"""What follows a column's name, and what its numbers are multiplied by."""

_LARGEST_FILE = 64_000_000  # bytes, of a day at 10 Hz
_LARGEST_COORDINATE = 2.0  # m; beyond it the file is most likely in mm
_LONGEST_INTERVAL = 10.0  # s between samples; beyond it times are most likely in ms


def load_recording(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Reads a recorded tip motion.

    Args:
        path: A CSV file, header `t,x,y,z`, or with units, e.g. `t_ms,x_mm,y_mm,z_mm`.

    Returns:
        Times in s since the first sample, shape (n,), strictly increasing, and p_WP in
        m, shape (n, 3).

    Raises:
        ValueError: If the file cannot be read, lacks a column, holds something other
            than finite numbers, is not sorted by time, holds fewer than two samples,
            or is in other units than its header says. The message names file and
            line, and quotes no text of the file, which may be any file.
    """
    try:
        data = read_regular(Path(path), _LARGEST_FILE)
        marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = data.decode("utf-16" if marked else "utf-8-sig")
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        reason = error.strerror
        raise ValueError(f"recording {path}: cannot be read: {reason}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"recording {path}: cannot be read as CSV") from error
    columns = _columns(path, [name.strip() for name in rows[0]] if rows else [])
    samples: list[list[float]] = []
    first = 0.0
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue  # an empty line, as at the end of many files
        at = f"recording {path}, line {number}"
        try:
            raw = [float(row[index]) for index, _ in columns]
        except (ValueError, IndexError) as error:
            raise ValueError(
                f"{at}: expected a number in each of the columns t,x,y,z"
            ) from error
        if not all(map(math.isfinite, raw)):
            raise ValueError(f"{at}: {raw} is not finite")
        first = raw[0] if not samples else first
        raw[0] -= first  # before it is scaled: an epoch in ns has many digits
        sample = [value * scale for value, (_, scale) in zip(raw, columns, strict=True)]
        if samples and not sample[0] > samples[-1][0]:
            raise ValueError(
                f"{at}: time {sample[0]} s does not follow {samples[-1][0]} s; times "
                "must increase from line to line"
            )
        if max(map(abs, sample[1:])) > _LARGEST_COORDINATE:
            raise ValueError(
                f"{at}: coordinates {sample[1:]} are over {_LARGEST_COORDINATE} m; are "
                "they in mm? expected m, or columns x_mm,y_mm,z_mm"
            )
        samples.append(sample)
    if len(samples) < 2:
        raise ValueError(
            f"recording {path}: {len(samples)} samples are too few, expected at least 2"
        )
    table = np.array(samples)
    interval = float(np.median(np.diff(table[:, 0])))
    if interval >= _LONGEST_INTERVAL:
        raise ValueError(
            f"recording {path}: samples are {interval:.4g} s apart, expected less than "
            f"{_LONGEST_INTERVAL} s; are the times in ms? then the column is t_ms"
        )
    return table[:, 0], table[:, 1:]


def _columns(path: str | Path, header: list[str]) -> list[tuple[int, float]]:
    """Where a recording's columns stand, and what their numbers are multiplied by."""
    found = []
    for name in COLUMNS:
        units = _TIMES if name == "t" else _LENGTHS
        places = [(name + unit, scale) for unit, scale in units.items()]
        found.append([(header.index(n), scale) for n, scale in places if n in header])
    wrong = [n for n, places in zip(COLUMNS, found, strict=True) if len(places) != 1]
    if wrong:
        raise ValueError(
            f"recording {path}: column {', '.join(wrong)} missing, or there more than "
            "once, expected 't,x,y,z', or with units, e.g. 't_ms,x_mm,y_mm,z_mm'"
        )
    return [places[0] for places in found]


def save_recording(path: str | Path, times: np.ndarray, points: np.ndarray) -> None:
    """Writes a recording, times to 0.1 ms and positions to 1 um.

    Args:
        path: The file to write.
        times: In s, shape (n,).
        points: p_WP in m, shape (n, 3).
    """
    lines = [",".join(COLUMNS)]
    for t, (x, y, z) in zip(times, points, strict=True):
        lines.append(f"{t:.4f},{x:.6f},{y:.6f},{z:.6f}")
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def synthesize_sweep(
    seed: int,
    via: Sequence[Sequence[float]],
    duration: float = 20.0,
    rate: float = 30.0,
    mean_speed: float = 0.010,
    tremor_rms: float = 100e-6,
) -> tuple[np.ndarray, np.ndarray]:
    """Makes the motion of a hand that works its way along given points.

    A hand moves in strokes with bell-shaped speed (minimum jerk), large and small,
    that overlap, and rests in between. Here stroke after stroke goes a random part
    of the way to the next point, a little beside it; peak speeds are log-normal, so
    that the speeds have the heavy tail of a surgeon's: mean about 10 mm/s, 95th
    percentile 36 mm/s, 99th 57 mm/s. No stroke is shorter than 0.6 s, so that 99 % of
    the power lies below 2 Hz. Tremor of 8 to 12 Hz is added.

    Args:
        seed: Same seed, same motion.
        via: Points p_WP in m; the strokes go from one to the next and begin again.
        duration: In s.
        rate: Samples in a second.
        mean_speed: In m/s, of the whole recording without its tremor.
        tremor_rms: In m, in three dimensions.

    Returns:
        Times in s, shape (n,), and p_WP in m, shape (n, 3).
    """
    rng = np.random.default_rng(seed)
    points = np.asarray(via, float)
    strokes: list[tuple[float, float, np.ndarray]] = []  # start, duration, way
    here, goal, clock = points[0].copy(), 1, 0.0
    while clock < duration:
        way = points[goal % len(points)] - here
        if np.linalg.norm(way) < 0.006:
            goal += 1
            continue
        step = way * rng.uniform(0.2, 0.7) + rng.normal(0.0, 0.0015, 3)
        peak = 2.6 * mean_speed * math.exp(rng.normal(0.0, 0.75))
        stroke = max(0.6, 1.875 * float(np.linalg.norm(step)) / peak)
        strokes.append((clock, stroke, step))
        here = here + step
        clock += stroke * rng.uniform(0.75, 1.0) + rng.exponential(0.35)
    times = np.arange(round(duration * rate) + 1) / rate
    path = np.tile(points[0], (len(times), 1))
    for start, stroke, step in strokes:
        s = np.clip((times - start) / stroke, 0.0, 1.0)
        path += (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * step
    waves = 4
    for axis in range(3):
        for hertz in rng.uniform(8.0, 12.0, waves):
            phase = rng.uniform(0.0, 2.0 * math.pi)
            amplitude = tremor_rms * math.sqrt(2.0 / (3.0 * waves))
            path[:, axis] += amplitude * np.sin(2.0 * math.pi * hertz * times + phase)
    return times, path
