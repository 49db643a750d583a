"""Tapes: what came into a diagram from outside while it ran, to be played back.

A tape is a CSV file `t,...`: the time in s at which something was said, and the columns
of the signal. What was said holds until the next line. Numbers are written whole, so
that what is played back is the run that was.
"""

from collections.abc import Sequence
import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from systems.common.archive import read_regular
from systems.common.signal import columns

_LARGEST_FILE = 256_000_000  # bytes, of hours at 60 Hz


def load_tape(path: str | Path, signal: Any) -> tuple[np.ndarray, np.ndarray]:
    """Reads a tape.

    Args:
        path: The CSV file.
        signal: What was said, its declaration.

    Returns:
        Times in s, shape (n,), increasing, and the elements, shape (n, size).

    Raises:
        ValueError: If the file cannot be read or is not a tape of this signal; the
            message names file and line, and quotes no text of the file.
    """
    names = ["t", *columns(signal)]
    try:
        text = read_regular(Path(path), _LARGEST_FILE).decode("utf-8")
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        raise ValueError(f"tape {path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"tape {path}: cannot be read as CSV") from error
    if not lines or lines[0] != names:
        raise ValueError(f"tape {path}, line 1: expected {','.join(names)!r}")
    rows: list[list[float]] = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            row = [float(item) for item in line]
        except ValueError:
            row = []
        if len(row) != len(names) or not np.isfinite(row).all():
            raise ValueError(
                f"tape {path}, line {number}: expected {len(names)} finite numbers"
            )
        if rows and not row[0] > rows[-1][0]:
            raise ValueError(f"tape {path}, line {number}: times must increase")
        rows.append(row)
    if not rows:
        raise ValueError(f"tape {path}: nothing was said, expected at least a line")
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def save_tape(
    path: str | Path, signal: Any, times: Sequence[float], rows: Sequence[Any]
) -> None:
    """Writes a tape; arguments as `load_tape` returns them."""
    lines = [",".join(["t", *columns(signal)])]
    for time, row in zip(times, rows, strict=True):
        lines.append(",".join(repr(float(number)) for number in (time, *row)))
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
