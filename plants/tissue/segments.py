"""Segments of DICOM objects: what a file has, and which of it is meant."""

from collections.abc import Callable
from dataclasses import dataclass
import difflib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import MaskError

MM = 1e-3
MOST_NAMED = 20
"""Segments of which a message has the names."""

type Mask = NDArray[np.bool_]


@dataclass
class Segments:
    """What a file has, of which nothing has been made voxels yet.

    Attributes:
        names: By number.
        sizes: nx, ny, nz.
        X_PV: From voxel indices to P in m, (4, 4).
        mask: The voxels of a segment, (nx, ny, nz).
        notes: What had to be assumed.
    """

    names: dict[int, str]
    sizes: tuple[int, ...]
    X_PV: NDArray[np.float64]
    mask: Callable[[int], Mask]
    notes: list[str]


def is_dicom(path: Path) -> bool:
    """Whether a file begins as DICOM does, whatever it is called."""
    with path.open("rb") as stream:
        return stream.read(132)[128:] == b"DICM"


def header(path: Path, *tags: str) -> Any:
    """A file's attributes but for its pixels; those named alone, if any are.

    Raises:
        MaskError: If DICOM is not installed.
    """
    try:
        import pydicom
    except ImportError:
        raise MaskError(
            "it is DICOM, which needs highdicom: pip install 'trocar[dicom]'"
        ) from None
    pydicom.config.settings.reading_validation_mode = pydicom.config.IGNORE
    return pydicom.dcmread(path, stop_before_pixels=True, specific_tags=tags or None)


def kind_of(path: Path) -> str:
    """The modality that a DICOM file names: SEG, RTSTRUCT, CT, ..."""
    return str(header(path, "Modality").get("Modality", ""))


def listed(names: dict[int, str]) -> str:
    """Segments as text: numbers and names."""
    if not names:
        return "no segment"
    some = [f"{n} {name!r}" for n, name in list(names.items())[:MOST_NAMED]]
    return ", ".join(some) + (", ..." if len(names) > MOST_NAMED else "")


def number_of(asked: int | str, names: dict[int, str], key: str) -> int:
    """The number of a segment, asked for by number or name, upper case or lower."""
    if asked in names:
        return int(asked)
    folded = {n: name.strip().casefold() for n, name in names.items()}
    found = [n for n, name in folded.items() if name == str(asked).strip().casefold()]
    if len(found) == 1 and isinstance(asked, str):
        return found[0]
    what = f"labels.{key}={asked!r}"
    if found and isinstance(asked, str):
        raise MaskError(f"{what}: {len(found)} are called so: expected one of {found}")
    if isinstance(asked, int):
        near = min(names, key=lambda n: abs(n - asked), default=0)
        hint = f"the nearest is {near}"
    else:
        close = difflib.get_close_matches(str(asked).casefold(), folded.values(), 1, 0)
        near = next((n for n, name in folded.items() if name in close), 0)
        hint = f"did you mean {names.get(near, '')!r}?"
    raise MaskError(
        f"{what}: it has no such segment; there are {listed(names)}; {hint}"
    )
