"""DICOM: segments of a SEG or RTSTRUCT object, chosen by their numbers or names.

Positions in DICOM are LPS, in mm. Which segments overlap is left open by both kinds:
what is tumour and critical is critical.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import warnings

import numpy as np

from plants.tissue.image import Image, MaskError, check_sizes, damaged, pose
from plants.tissue.labels import BRAIN, CRITICAL, TUMOUR
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.rtstruct import images_of, structures
from plants.tissue.segments import MM, Mask, Segments, kind_of, listed, number_of


def read_dicom(path: Path, wanted: MaskLabels) -> Image:
    """Reads a SEG or RTSTRUCT object, the latter with the CT that lies near it.

    Returns:
        Whose values are BRAIN, TUMOUR and CRITICAL.

    Raises:
        MaskError: If it is damaged, another kind, or has not the segments wanted.
    """
    if wanted.threshold is not None:
        raise MaskError("labels.threshold: it has segments, and no values")
    with _trusted_with_nothing():
        return _labelled(opened(path), wanted)


def files_of(path: Path) -> list[Path]:
    """A DICOM file, and the images that it was drawn on if it needs them.

    Raises:
        MaskError: If it is damaged, or they are not there.
    """
    with _trusted_with_nothing():
        return [path, *(images_of(path) if kind_of(path) == "RTSTRUCT" else ())]


@contextmanager
def _trusted_with_nothing() -> Iterator[None]:
    """Makes whatever the libraries meet in a damaged file one error."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (MaskError, OSError, MemoryError):
        raise
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise damaged(f"{type(error).__name__}: {said}") from None


def opened(path: Path) -> Segments:
    """The segments of a file of either kind."""
    kind = kind_of(path)
    if kind == "SEG":
        return _segmentation(path)
    if kind == "RTSTRUCT":
        return structures(path)
    raise MaskError(f"it is DICOM of modality {kind!r}: expected SEG or RTSTRUCT")


def _labelled(told: Segments, wanted: MaskLabels) -> Image:
    check_sizes(told.sizes)
    critical = [number_of(n, told.names, "critical") for n in wanted.critical]
    tumour = [number_of(n, told.names, "tumour") for n in wanted.tumour]
    if not tumour:
        tumour = [n for n in told.names if n not in critical]
        if len(tumour) != 1:
            raise MaskError(
                f"it has {listed(told.names)}: name the tumour's with labels.tumour, "
                f"e.g. [{next(iter(told.names), 1)}]"
            )
    both = sorted(set(tumour) & set(critical))
    if both:
        raise MaskError(f"segments {both} are named as tumour and as critical")
    values = np.full(told.sizes, BRAIN, np.uint8)
    for number in tumour:
        values[told.mask(number)] = TUMOUR
    whole = np.count_nonzero(values == TUMOUR)
    for number in critical:
        mask = told.mask(number)
        if not mask.any():
            told.notes.append(f"critical segment {told.names[number]!r} is empty")
        values[mask] = CRITICAL
    left = np.count_nonzero(values == TUMOUR)
    if left == 0:
        named = listed({n: told.names[n] for n in tumour})
        raise MaskError(f"the mask is empty, no voxel is tumour: {named}")
    if left < whole:
        voxel = 1e9 * abs(float(np.linalg.det(told.X_PV[:3, :3])))
        told.notes.append(
            f"{voxel * (whole - left):.3g} mm3 are tumour and critical: they are "
            "taken for critical"
        )
    return Image(values, told.X_PV, told.notes)


def _segmentation(path: Path) -> Segments:
    """A SEG object: bits, fractions (half and more is taken), or a label map."""
    import highdicom

    seg = highdicom.seg.segread(path)
    names = {
        n: str(seg.get_segment_description(n).segment_label)
        for n in seg.segment_numbers
    }
    at = seg.get_volume_geometry()
    if at is None:
        raise MaskError(
            "its frames are no volume: expected slices that lie evenly, one above "
            "the other, in the patient; resample it"
        )
    X = at.affine[:, [2, 1, 0, 3]]  # columns run along x, rows along y
    X_PV = pose(MM * X[:3, :3], MM * X[:3, 3])
    sizes = tuple(int(n) for n in at.spatial_shape[::-1])
    notes = []
    if seg.segmentation_type.value == "FRACTIONAL":
        notes.append("it has fractions: from a half on, a voxel is the segment's")
    # Empty frames may be left out: then its border is none of the image's.
    source = seg.get("ReferencedSeriesSequence")
    shown_in = len(source[0].get("ReferencedInstanceSequence", ())) if source else 0
    pad = int(shown_in > sizes[2])
    X_PV[:3, 3] -= pad * X_PV[:3, 2]

    def mask(number: int) -> Mask:
        part = seg.get_volume(segment_numbers=[number]).array[..., 0] >= 0.5
        return np.pad(part.transpose(2, 1, 0), ((0, 0), (0, 0), (pad, pad)))

    return Segments(names, (*sizes[:2], sizes[2] + 2 * pad), X_PV, mask, notes)
