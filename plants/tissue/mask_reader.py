"""Reads a mask in a process of its own, which is small and short-lived.

What a file asks for is refused before it is asked of the machine; this is the second
wall. It imports little, to start in a fraction of a second.

    python -m plants.tissue.mask_reader FILE < wanted labels, JSON; null for an image

It writes a line of JSON, and the labels or greys as .npy if the file has them.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
import json
from pathlib import Path
import resource
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.tissue.dicom import read_dicom
from plants.tissue.image import Image, MaskError
from plants.tissue.mask_labels import MaskLabels, labels_of
from plants.tissue.meta_image import read_meta_image
from plants.tissue.nifti import AUTO, read_nifti
from plants.tissue.nrrd import read_nrrd
from plants.tissue.segments import is_dicom

MOST_MEMORY = 6 * 2**30
"""Of the process, in bytes."""

READERS: dict[str, Callable[[Path], Image]] = {
    ".nrrd": read_nrrd,
    ".nhdr": read_nrrd,
    ".mha": read_meta_image,
    ".mhd": read_meta_image,
    ".nii": read_nifti,
    ".nii.gz": read_nifti,
}
"""By how a file's name ends."""


@dataclass
class Labelled:
    """The part of a mask that holds anything.

    Attributes:
        labels: As `labels_of` has them, (nx, ny, nz).
        X_PV: From indices of all of the image to P, (4, 4).
        corner: Index in the image of the part's first voxel.
        sizes: Of the image.
        notes: What had to be assumed.
    """

    labels: NDArray[np.uint8]
    X_PV: NDArray[np.float64]
    corner: tuple[int, ...]
    sizes: tuple[int, ...]
    notes: list[str]


def read(path: Path, wanted: MaskLabels) -> Labelled:
    """Reads the file that is named, and no other but what belongs to it beside it.

    That is a header's data, and the CT of an RTSTRUCT object.

    Raises:
        MaskError: If it is damaged, absurdly large, or no label map.
    """
    if is_dicom(path):
        image = read_dicom(path, wanted)
        return cropped(image.values, image)
    image = read_image(path, wanted.transform)
    return cropped(labels_of(image, wanted), image)


def cropped(labels: NDArray[np.uint8], image: Image) -> Labelled:
    """The part of an image's labels that holds anything."""
    box = []
    for axis in range(3):
        held = np.flatnonzero(labels.any(axis=tuple({0, 1, 2} - {axis})))
        box.append(slice(int(held[0]), int(held[-1]) + 1))
    corner = tuple(part.start for part in box)
    return Labelled(labels[tuple(box)], image.X_PV, corner, labels.shape, image.notes)


def read_image(path: Path, transform: str = AUTO) -> Image:
    """Reads the file that is named, and no other but a header's data beside it.

    Raises:
        MaskError: If it is damaged or absurdly large.
    """
    ending = [end for end in READERS if path.name.lower().endswith(end)]
    if not ending:
        raise MaskError(
            f"expected a file whose name ends in {', '.join(READERS)}; export "
            "other kinds but DICOM (SEG, RTSTRUCT) as one of these"
        )
    reader = READERS[ending[0]]
    if reader is read_nifti:
        return read_nifti(path, transform)
    if transform == AUTO:
        return reader(path)
    raise MaskError(f"labels.transform={transform}: only NIfTI has two")


def greys_of(values: NDArray) -> NDArray[np.uint8]:
    """An image's values as greys, from its darkest percent to its brightest.

    Raises:
        MaskError: If none is finite.
    """
    some = values[tuple(slice(None, None, max(n // 128, 1)) for n in values.shape)]
    some = some[np.isfinite(some)]
    if some.size == 0:
        raise MaskError("its values are not finite: expected an image")
    low, high = np.percentile(some, (1, 99))
    if low == high:  # a mask, most of it background
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
    greys = np.empty(values.shape, np.uint8, order="F")
    for k in range(values.shape[2]):  # no copy of a large image is made
        share = (values[..., k] - low) / max(high - low, 1e-12)
        greys[..., k] = np.rint(255 * np.clip(np.nan_to_num(share), 0.0, 1.0))
    return greys


def main() -> None:
    """The process: limits itself, reads, answers."""
    with suppress(ValueError, OSError):  # where there is no such limit
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    try:
        path, wanted = Path(sys.argv[1]), json.load(sys.stdin)
        if wanted is None:
            image = read_image(path)
            values, told = greys_of(image.values), {"X_PV": image.X_PV.tolist()}
        else:
            part = read(path, MaskLabels(**wanted))
            values, told = (
                part.labels,
                {
                    "X_PV": part.X_PV.tolist(),
                    "corner": part.corner,
                    "sizes": part.sizes,
                    "notes": part.notes,
                },
            )
    except MaskError as error:
        answer(error=str(error))
    except OSError as error:
        answer(error=f"it cannot be read: {error.strerror}")
    except MemoryError:
        answer(error=f"it takes more than {MOST_MEMORY / 2**30:.0f} GiB to read")
    else:
        answer(**told)
        np.save(sys.stdout.buffer, values, allow_pickle=False)


def answer(**told: Any) -> None:
    """Writes a line of JSON."""
    sys.stdout.buffer.write(json.dumps(told).encode() + b"\n")


if __name__ == "__main__":
    main()
