"""A patient's mask: from a file to the tissue that it labels."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
import io
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.tissue import mask_reader
from plants.tissue.image import Image, MaskError
from plants.tissue.labels import BRAIN, TUMOUR
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.mask_reader import Labelled
from plants.tissue.tissue import Grid, Tissue, parts_by_size
from systems.common.parameter import check

MOST_TIME = 120
"""For reading a mask, in s."""

LEAST_WIDTH, MOST_WIDTH = 2e-3, 0.2
"""Of a tumour, in m."""

SPECK = 0.02
"""Share of all that is tumour below which a part is no tumour of its own."""


def load_mask(path: str | Path, labels: MaskLabels | None = None) -> Tissue:
    """Reads a label map: NRRD, NIfTI, MetaImage, DICOM's SEG and RTSTRUCT.

    Args:
        path: The file; its own affine is kept. P is LPS, whatever the file's frame.
        labels: What its labels mean.

    Raises:
        ValueError: If the file is damaged, is no label map, or does not hold the
            tumour that is wanted; it says what was expected.
    """
    wanted, file = labels or MaskLabels(), Path(path)
    check(wanted, "labels")
    with _named("mask", file):
        told, values = _read_apart(file, asdict(wanted))
        part = Labelled(values, np.array(told.pop("X_PV")), **told)
        return tissue_of(part, wanted.component, file.name)


def load_image(path: str | Path) -> Image:
    """Reads an image as greys, uint8, to be looked at: what `load_mask` reads too.

    Args:
        path: The file; its own affine is kept.

    Raises:
        ValueError: If the file is damaged or no image; it says what was expected.
    """
    file = Path(path)
    with _named("image", file):
        told, values = _read_apart(file, None)
        return Image(values, np.array(told["X_PV"]))


@contextmanager
def _named(what: str, file: Path) -> Iterator[None]:
    """What is wrong with a file is said with its name."""
    try:
        if not file.exists():
            raise MaskError("no such file")
        if not file.is_file():
            raise MaskError("it is no file")
        yield
        return
    except MaskError as error:
        why = str(error)
    except OSError as error:
        why = f"it cannot be read: {error.strerror}"
    raise MaskError(f"{what} {str(file)!r}: {why}")


def _read_apart(
    file: Path, wanted: dict[str, Any] | None
) -> tuple[dict[str, Any], NDArray[np.uint8]]:
    """Reads a mask, or an image if no labels are wanted, in a process of its own."""
    # It finds its modules where this one does, but for the folder it is started in:
    # nothing that lies beside a mask is imported.
    home = str(Path(__file__).parents[2])
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([home, *filter(None, sys.path)]),
        "OPENBLAS_NUM_THREADS": "1",  # each would reserve memory
    }
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", mask_reader.__name__, str(file)],
            input=json.dumps(wanted).encode(),
            capture_output=True,
            env=environment,
            timeout=MOST_TIME,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise MaskError(f"it takes more than {MOST_TIME} s to read") from None
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        why = said[-1] if said else f"its reader ended with {done.returncode}"
        raise MaskError(f"it cannot be read: {why}")
    stream = io.BytesIO(done.stdout)
    told = json.loads(stream.readline())
    if "error" in told:
        raise MaskError(told["error"])
    return told, np.load(stream, allow_pickle=False)


def tissue_of(part: Labelled, component: int, name: str) -> Tissue:
    """The tissue of a mask, of whose tumours one is taken."""
    notes = list(part.notes)
    tumour = part.labels == TUMOUR
    numbers, sizes = parts_by_size(tumour)
    voxel = abs(float(np.linalg.det(part.X_PV[:3, :3])))
    chosen = numbers == _chosen(sizes, component)
    width = _width(chosen, part.X_PV)
    if not LEAST_WIDTH <= width <= MOST_WIDTH:
        raise MaskError(_wrong_width(width))
    left = tumour & ~chosen
    if left.any():
        notes.append(
            f"of what is tumour {1e9 * voxel * np.count_nonzero(left):.3g} mm3 in "
            f"{len(sizes) - 1} parts that the chosen one "
            f"({1e9 * voxel * np.count_nonzero(chosen):.4g} mm3) does not touch by a "
            "face are left out"
        )
    where = np.argwhere(chosen) + part.corner
    if (where.min(axis=0) == 0).any() or (where.max(axis=0) + 1 == part.sizes).any():
        notes.append("the tumour touches the image's border and may be cut off there")
    labels = np.where(left, BRAIN, part.labels).astype(np.uint8)
    X_PV = part.X_PV.copy()
    X_PV[:3, 3] += X_PV[:3, :3] @ (np.array(part.corner) - 1)
    padded = np.pad(labels, 1, constant_values=BRAIN)
    image = Grid(tuple(part.sizes), part.X_PV)
    return Tissue(padded, X_PV, name, is_mask=True, notes=notes, image=image)


def _chosen(sizes: NDArray[np.int64], component: int) -> int:
    shares = ", ".join(f"{100 * size / sizes.sum():.0f} %" for size in sizes[:5])
    serious = int(np.count_nonzero(sizes > SPECK * sizes.sum()))
    if component == 0 and serious > 1:
        raise MaskError(
            f"{serious} tumours that do not touch by a face ({shares} of the whole); "
            "choose one with labels.component=1 (the largest), 2, ..."
        )
    if component > len(sizes):
        raise MaskError(
            f"labels.component={component}: it has {len(sizes)} ({shares} of the "
            f"whole); the nearest is {len(sizes)}"
        )
    return max(component, 1)


def _width(mask: NDArray[np.bool_], X_PV: NDArray[np.float64]) -> float:
    """The longest side of the box about a mask, along the image's axes, in m."""
    box = np.ptp(np.argwhere(mask), axis=0) + 1
    return float((box * np.linalg.norm(X_PV[:3, :3], axis=0)).max())


def _wrong_width(width: float) -> str:
    text = f"the tumour would be {_length(width)} wide: expected 2 to 200 mm"
    if LEAST_WIDTH <= 1e-3 * width <= MOST_WIDTH:
        return (
            f"{text}; it seems to be in mm and says m: divide its spacing and origin "
            "by 1000, or set its unit to mm"
        )
    if LEAST_WIDTH <= 1e3 * width <= MOST_WIDTH:
        return (
            f"{text}; it seems to be in m and is read as mm: multiply its spacing and "
            "origin by 1000, or set its unit to m"
        )
    return f"{text}; is the label the tumour's, and its unit right?"


def _length(metres: float) -> str:
    if metres >= 1.0:
        return f"{metres:.3g} m"
    return f"{1e3 * metres:.3g} mm" if metres >= 1e-3 else f"{1e6 * metres:.3g} µm"
