"""What a mask's numbers mean: which voxels are tumour, and which are critical."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import Image, MaskError
from plants.tissue.labels import BRAIN, CRITICAL, TUMOUR
from plants.tissue.nifti import AUTO, TRANSFORMS
from systems.common.parameter import Rules, parameter

HIGHEST = 2**16 - 1
MOST_LABELS = 256
"""Of one mask; an image that was taken for a mask has more values."""

MOST_UNNAMED = 16
"""Labels of a mask that are all taken for tumour if none is named."""


@dataclass
class MaskLabels:
    """Which labels of a mask mean what."""

    tumour: list[int | str] = parameter(
        [],
        "labels that are tumour, of DICOM's segments numbers or names; all but 0 and "
        "the critical ones if empty",
        least=0,
        most=HIGHEST,
        shape=(-1,),
    )
    critical: list[int | str] = parameter(
        [], "labels that must not be touched", least=0, most=HIGHEST, shape=(-1,)
    )
    component: int = parameter(
        0,
        "which part that is connected by faces is operated on: 1 for the largest, "
        "2, ...; 0 if there must be one alone",
        least=0,
        most=1000,
    )
    threshold: float | None = parameter(
        None,
        "all from this value on is tumour, of an image that is no label map",
        least=-1e6,
        most=1e6,
    )
    transform: str = parameter(
        AUTO,
        "which transform of a NIfTI file that has two is taken; auto is the qform",
        choices=TRANSFORMS,
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        named = [*self.tumour, *self.critical]
        yield (
            not set(self.tumour) & set(self.critical),
            "tumour",
            f"none of the critical ones, {self.critical}",
        )
        yield (
            self.threshold is None or not named,
            "threshold",
            "none where labels.tumour or labels.critical name labels",
        )


def labels_of(image: Image, wanted: MaskLabels) -> NDArray[np.uint8]:
    """BRAIN, TUMOUR or CRITICAL of each voxel of an image, (nx, ny, nz).

    Raises:
        MaskError: If it is no label map, or has not the labels wanted.
    """
    values = image.values
    low, high = float(values.min()), float(values.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise MaskError("its values are not all finite: expected a label map")
    if wanted.threshold is not None:
        if not low < wanted.threshold <= high:
            raise MaskError(
                f"labels.threshold={wanted.threshold:g}: its values go from {low:g} to "
                f"{high:g}; expected > {low:g} and <= {high:g}"
            )
        return np.where(values >= wanted.threshold, TUMOUR, BRAIN).astype(np.uint8)
    if low < 0.0 or high > HIGHEST:
        raise _no_label_map(values, f"values from {low:g} to {high:g}")
    counts = np.zeros(HIGHEST + 1, int)
    for whole in _slices(values):
        counts += np.bincount(whole.ravel(), minlength=HIGHEST + 1)
    there = np.flatnonzero(counts).tolist()
    if len(there) > MOST_LABELS:
        raise _no_label_map(values, f"{len(there)} values from {low:g} to {high:g}")
    meaning = np.zeros(HIGHEST + 1, np.uint8)
    meaning[np.array(_tumour_of(there, wanted, image.notes))] = TUMOUR
    meaning[np.array(wanted.critical, int)] = CRITICAL
    labels = np.empty(values.shape, np.uint8, order="F")
    for k, whole in enumerate(_slices(values)):
        labels[..., k] = meaning[whole]
    return labels


def _slices(values: NDArray) -> Iterator[NDArray[np.uint16]]:
    """Whole numbers, slice by slice, so that no copy of a large image is made."""
    for k in range(values.shape[2]):
        whole = np.rint(values[..., k])
        broken = np.abs(values[..., k] - whole) > 1e-3
        if broken.any():
            found = f"{values[..., k][broken][0]:g} among its values"
            raise _no_label_map(values, found)
        yield whole.astype(np.uint16)


def _no_label_map(values: NDArray, why: str) -> MaskError:
    half = (float(values.min()) + float(values.max())) / 2
    return MaskError(
        f"it has {why}: expected a label map, whole numbers from 0 to {HIGHEST}, at "
        f"most {MOST_LABELS} different ones. If all from some value on is tumour, say "
        f"from which, e.g. labels.threshold={half:g}"
    )


def _tumour_of(
    there: list[int], wanted: MaskLabels, notes: list[str]
) -> list[int | str]:
    """Which labels of those there are tumour."""
    found = [label for label in there if label != 0]
    for key, labels in (("tumour", wanted.tumour), ("critical", wanted.critical)):
        for label in labels:
            if isinstance(label, str):
                raise MaskError(
                    f"labels.{key}={labels}: expected numbers, only DICOM's segments "
                    f"have names; it has {_some(found)}"
                )
            if label == 0:
                raise MaskError(
                    f"labels.{key}={labels}: 0 is the background; it has {_some(found)}"
                )
            if label not in there:
                nearest = min(found or [0], key=lambda other: abs(other - label))
                raise MaskError(
                    f"labels.{key}={labels}: it has no label {label}; there are "
                    f"{_some(there)}, the nearest is {nearest}"
                )
    if wanted.tumour:
        return wanted.tumour
    rest: list[int | str] = [label for label in found if label not in wanted.critical]
    if not rest:
        raise MaskError(f"the mask is empty, no voxel is tumour: it has {_some(there)}")
    if 0 not in there:
        raise MaskError(
            f"no voxel is background (0): it has {_some(there)}; name the tumour's "
            "with labels.tumour"
        )
    if len(rest) > MOST_UNNAMED:
        raise MaskError(
            f"it has {len(rest)} labels, {_some(rest)}: name the tumour's with "
            f"labels.tumour, e.g. [{rest[0]}]"
        )
    if len(rest) > 1:
        notes.append(f"labels {_some(rest)} are all taken for tumour")
    return rest


def _some(labels: Sequence[int | str]) -> str:
    if len(labels) <= 12:
        return str(list(labels))
    return f"[{', '.join(map(str, labels[:10]))}, ..., {labels[-1]}]"
