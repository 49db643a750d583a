"""How far a plan has been carried out: what a run that was killed goes on from."""

from dataclasses import dataclass, field
import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.tissue.space import SOLID
from systems.common.archive import (
    check_arrays,
    read_archive,
    sensible,
    write_archive,
)

FORMAT = 1
"""Of an execution's file."""


@dataclass
class Execution:
    """What has been done of a plan.

    Attributes:
        posture: Index of the plan's posture that the robot last reached.
        time: Simulated time that it took, in s.
        index: Moves carved.
        removed: Tumour and other tissue removed, in m3, (2).
        touched: Checks with the body in tissue, and least distance to what is
            critical in m, -1 if nothing is, (2).
        way: Path of the tool in m.
        tau: Arrival times of the executed tissue, (nx, ny, nz); None at first.
        bored: Moves after which further channels were bored.
    """

    posture: int = 0
    time: float = 0.0
    index: int = 0
    removed: tuple[float, float] = (0.0, 0.0)
    touched: tuple[float, float] = (0.0, -1.0)
    way: float = 0.0
    tau: NDArray[np.int32] | None = None
    bored: list[int] = field(default_factory=list)


def _digest(postures: NDArray) -> str:
    return hashlib.sha256(np.ascontiguousarray(postures).tobytes()).hexdigest()


def save_execution(path: Path, done: Execution, postures: NDArray) -> None:
    """Writes what has been done of a plan.

    Args:
        path: The file; the one before it is kept.
        done: What has been done.
        postures: Of the plan, (n, 7).
    """
    meta: dict[str, Any] = {
        name: value for name, value in vars(done).items() if name != "tau"
    }
    meta["format"] = FORMAT
    meta["plan"] = _digest(postures[: done.posture + 1])
    write_archive(path, meta, {"tau": done.tau})


def load_execution(path: Path, postures: NDArray, shape: tuple[int, ...]) -> Execution:
    """What has been done of a plan; nothing if there is no file.

    Args:
        path: The file.
        postures: Of the plan, (n, 7). It may have grown since.
        shape: Of the tissue's voxels.

    Raises:
        ValueError: If the file is damaged, makes no sense, or is of another plan.
    """
    if not path.is_file():
        return Execution()
    meta, arrays = read_archive(path, "execution", FORMAT)
    with sensible(path, "execution"):
        plan, posture = meta.pop("plan"), meta["posture"]
        done = _restored(meta, arrays, len(postures), shape)
    if plan != _digest(postures[: posture + 1]):
        raise ValueError(
            f"execution {str(path)!r} is of another plan: move it away to carry this "
            "plan out from its beginning"
        )
    return done


def _restored(
    meta: dict[str, Any], arrays: dict[str, Any], visits: int, shape: tuple[int, ...]
) -> Execution:
    removed, touched = map(float, meta["removed"]), map(float, meta["touched"])
    done = Execution(
        int(meta["posture"]),
        float(meta["time"]),
        int(meta["index"]),
        (next(removed), next(removed)),
        (next(touched), next(touched)),
        float(meta["way"]),
        arrays["tau"],
        [int(move) for move in meta.get("bored", [])],
    )
    check_arrays(arrays, {"tau": ("i4", shape)})
    numbers = (done.time, done.way, done.index, done.posture, *done.removed)
    if not all(0 <= number < math.inf for number in numbers):
        raise ValueError("a time, a way or an amount below zero")
    if not done.posture < visits or not done.index < SOLID:
        raise ValueError(f"posture {done.posture} of {visits}")
    tau = arrays["tau"]
    if not ((tau == SOLID) | (tau >= 0) & (tau <= done.index)).all():
        raise ValueError("an arrival at no move")
    return done
