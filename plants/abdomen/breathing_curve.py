"""A recorded breath in the place of a made one: a curve between -1 and 1 over time."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from systems.common.archive import read_regular

LARGEST = 64_000_000
"""Of a file, in bytes."""


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    text = read_regular(path, LARGEST).decode("utf-8-sig")
    rows = [line.split(",") for line in text.splitlines() if line.strip()]
    if len(rows) < 3:
        raise ValueError(f"{len(rows)} lines: expected a header and two samples")
    return [name.strip() for name in rows[0]], rows[1:]


@lru_cache(maxsize=8)
def load_curve(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times in s from 0 on, rising, and the curve in [-1, 1].

    Args:
        path: A CSV file, header `t,b`.

    Raises:
        ValueError: If it is none.
    """
    try:
        header, rows = _table(Path(path))
        columns = [header.index("t"), header.index("b")]
        table = np.array(rows, float)[:, columns]
    except (OSError, ValueError) as error:
        raise ValueError(f"breathing curve {path}: expected CSV t,b: {error}") from None
    t, b = table.T
    if not (np.isfinite(table).all() and t[0] == 0.0 and (np.diff(t) > 0.0).all()):
        raise ValueError(f"breathing curve {path}: times must rise from 0")
    if np.abs(b).max() > 1.0:
        raise ValueError(f"breathing curve {path}: expected numbers in [-1, 1]")
    return t, b


def read_unitless(path: Path, column: str, rate: float) -> NDArray[np.float64]:
    """A respiration belt's signal as a curve: times and numbers in [-1, 1], (n, 2).

    Its 2nd and 98th percentile become -1 and 1; what lies beyond is clipped.

    Args:
        path: A CSV file with a header and no time.
        column: Its column.
        rate: Samples a second.

    Raises:
        ValueError: If there is no such column, or it does not move.
    """
    header, rows = _table(path)
    if column not in header:
        raise ValueError(f"column {column!r}: it has {', '.join(header)[:200]}")
    signal = np.array([row[header.index(column)] for row in rows], float)
    low, high = np.quantile(signal, [0.02, 0.98])
    if not (np.isfinite(signal).all() and high > low):
        raise ValueError(f"column {column!r} does not move, or is not finite")
    curve = np.clip(2.0 * (signal - low) / (high - low) - 1.0, -1.0, 1.0)
    return np.column_stack([np.arange(len(curve)) / rate, curve])
