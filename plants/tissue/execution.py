"""How far a plan has been carried out: what a run that was killed goes on from."""

from dataclasses import dataclass, field
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.common.archive import read_archive, write_archive


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
    meta["plan"] = _digest(postures[: done.posture + 1])
    write_archive(path, meta, {"tau": done.tau})


def load_execution(path: Path, postures: NDArray) -> Execution:
    """What has been done of a plan; nothing if there is no file.

    Args:
        path: The file.
        postures: Of the plan, (n, 7). It may have grown since.

    Raises:
        ValueError: If the file is damaged, or of another plan.
    """
    if not path.is_file():
        return Execution()
    meta, arrays = read_archive(path, "execution")
    plan, posture = meta.pop("plan"), meta["posture"]
    if plan != _digest(postures[: posture + 1]):
        raise ValueError(
            f"execution {str(path)!r} is of another plan: move it away to carry this "
            "plan out from its beginning"
        )
    removed, touched = tuple(meta.pop("removed")), tuple(meta.pop("touched"))
    return Execution(**meta, removed=removed, touched=touched, tau=arrays["tau"])
