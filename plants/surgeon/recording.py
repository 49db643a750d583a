"""Recorded motions of a surgeon's tool: reading them, and making synthetic ones.

A recording is a CSV file with the header `t,x,y,z`: time in s and the tool's tip in
the world frame W (z up) in m. Other columns are ignored.
"""

import codecs
from collections.abc import Sequence
import csv
import io
import math
from pathlib import Path

import numpy as np

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

_LARGEST_COORDINATE = 2.0  # m; beyond it the file is most likely in mm


def load_recording(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Reads a recorded tip motion.

    Args:
        path: A CSV file, header `t,x,y,z`.

    Returns:
        Times in s, shape (n,), strictly increasing, and p_WP in m, shape (n, 3).

    Raises:
        ValueError: If the file cannot be read, lacks a column, holds something other
            than finite numbers, is not sorted by time, holds fewer than two samples,
            or is in another unit than metres. The message names file and line.
    """
    try:
        data = Path(path).read_bytes()
        marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = data.decode("utf-16" if marked else "utf-8-sig")
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"recording {path}: cannot be read: {error}") from error
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ValueError(
            f"recording {path}: column {', '.join(missing)} missing; the header is "
            f"{','.join(header)!r}, expected 't,x,y,z'"
        )
    index = [header.index(name) for name in COLUMNS]
    samples: list[list[float]] = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue  # an empty line, as at the end of many files
        try:
            sample = [float(row[i]) for i in index]
        except (ValueError, IndexError) as error:
            raise ValueError(
                f"recording {path}, line {number}: {','.join(row)!r} is not a number "
                f"in each of the columns t,x,y,z"
            ) from error
        if not all(map(math.isfinite, sample)):
            raise ValueError(
                f"recording {path}, line {number}: {','.join(row)!r} is not finite"
            )
        if samples and not sample[0] > samples[-1][0]:
            raise ValueError(
                f"recording {path}, line {number}: time {sample[0]} s does not follow "
                f"{samples[-1][0]} s; times must increase from line to line"
            )
        if max(map(abs, sample[1:])) > _LARGEST_COORDINATE:
            raise ValueError(
                f"recording {path}, line {number}: coordinates {sample[1:]} are over "
                f"{_LARGEST_COORDINATE} m; are they in mm? expected m"
            )
        samples.append(sample)
    if len(samples) < 2:
        raise ValueError(
            f"recording {path}: {len(samples)} samples are too few, expected at least 2"
        )
    table = np.array(samples)
    return table[:, 0], table[:, 1:]


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
