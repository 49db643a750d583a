"""RTSTRUCT: contours in planes, made voxels of the CT that they were drawn on.

What several contours of a plane enclose an odd number of times is inside. Where a
contour has none beside it because there is no slice, or because only every so many
were drawn on, the shape between is interpolated by its distance to the border.
"""

from collections import Counter
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import MaskError, check_sizes, damaged, pose
from plants.tissue.segments import MM, Mask, Segments, header, is_dicom

MOST_FILES = 20_000
"""That are looked at for slices."""

CLOSED = ("CLOSED_PLANAR", "CLOSEDPLANAR_XOR")
ON = 0.1
"""Of a slice's distance to the next, by which a contour may lie beside it."""

OWN = 1.5
"""Times the usual distance of a segment's contours that is filled between two."""

WHERE = (
    *("SOPInstanceUID", "SeriesInstanceUID", "Rows", "Columns", "PixelSpacing"),
    *("ImagePositionPatient", "ImageOrientationPatient", "NumberOfFrames"),
)

Array = NDArray[np.float64]


def structures(path: Path) -> Segments:
    """The segments of an RTSTRUCT object, on the grid of its CT.

    Raises:
        MaskError: If the CT is not there, or a segment lies beyond it.
    """
    told = header(path)
    names = {
        int(roi.ROINumber): str(roi.get("ROIName", ""))
        for roi in told.get("StructureSetROISequence", ())
    }
    contours = {
        int(roi.ReferencedROINumber): list(roi.get("ContourSequence", ()))
        for roi in told.get("ROIContourSequence", ())
    }
    names = {n: name for n, name in names.items() if contours.get(n)}
    notes: list[str] = []
    slices, sizes, X_PV = _grid([header(p, *WHERE) for p in images_of(path)], notes)
    missing = _named(told) - {str(image.SOPInstanceUID) for image in slices}
    if missing:
        notes.append(f"{len(missing)} images that it was drawn on are not there")
    X_VP = np.linalg.inv(X_PV)
    there = np.array([_position(image) for image in slices]) @ X_VP[2, :3] + X_VP[2, 3]

    def mask(number: int) -> Mask:
        name = f"segment {names[number]!r}"
        planes = _planes(contours[number], X_VP, sizes, name, notes)
        return _filled(planes, there, sizes, name, notes)

    return Segments(names, sizes, X_PV, mask, notes)


# The CT ------------------------------------------------------------------------


def images_of(path: Path) -> list[Path]:
    """The slices of the CT that an RTSTRUCT object was drawn on.

    They are looked for beside it, in folders there, and in folders beside its own.

    Raises:
        MaskError: If there are none.
    """
    told = header(path)
    series, images = _series(told), _named(told)
    folder = path.absolute().parent
    for group in (
        itertools.chain(folder.glob("*"), folder.glob("*/*")),
        folder.parent.glob("*/*"),
    ):
        found = {}
        for file in itertools.islice(sorted(group), MOST_FILES):
            if not (file.is_file() and is_dicom(file)):
                continue
            image = header(file, *WHERE)
            own = str(image.get("SOPInstanceUID"))
            if "ImagePositionPatient" in image and (
                own in images or image.get("SeriesInstanceUID") in series
            ):
                found[own] = file
        if found:
            return list(found.values())
    raise MaskError(
        f"the images that it was drawn on are not there (series {sorted(series)}): "
        f"expected them in {str(folder)!r} or a folder beside it"
    )


def _series(told: Any) -> set[str]:
    return {
        str(series.SeriesInstanceUID)
        for frame in told.get("ReferencedFrameOfReferenceSequence", ())
        for study in frame.get("RTReferencedStudySequence", ())
        for series in study.get("RTReferencedSeriesSequence", ())
    }


def _named(told: Any) -> set[str]:
    """Every image that contours name."""
    return {
        str(image.ReferencedSOPInstanceUID)
        for roi in told.get("ROIContourSequence", ())
        for contour in roi.get("ContourSequence", ())
        for image in contour.get("ContourImageSequence", ())
    }


def _position(image: Any) -> Array:
    return MM * np.array(image.ImagePositionPatient, float)


def _grid(images: list[Any], notes: list[str]) -> tuple[list[Any], Any, Array]:
    """The slices in their order, and the even grid on which they lie."""
    if any(int(image.get("NumberOfFrames") or 1) > 1 for image in images):
        raise MaskError("its images have several frames: expected one file a slice")

    def frame(image: Any) -> tuple[Any, ...]:
        turned = np.round(np.array(image.ImageOrientationPatient, float), 3) + 0.0
        spacing = np.round(np.array(image.PixelSpacing, float), 6)
        return *turned, *spacing, int(image.Rows), int(image.Columns)

    ((common, count),) = Counter(map(frame, images)).most_common(1)
    if count < len(images):
        notes.append(f"{len(images) - count} images of the series lie otherwise")
    slices = [image for image in images if frame(image) == common]
    along_row, along_column = np.array(
        slices[0].ImageOrientationPatient, float
    ).reshape(2, 3)
    normal = np.cross(along_row, along_column)
    slices.sort(key=lambda image: float(_position(image) @ normal))
    p = np.array([_position(image) for image in slices])
    z = p @ normal
    gaps = np.diff(z)
    slices = [
        slices[0],
        *(s for s, gap in zip(slices[1:], gaps, strict=True) if gap > 1e-6),
    ]
    z, gaps = z[[0, *(1 + np.flatnonzero(gaps > 1e-6))]], gaps[gaps > 1e-6]
    if len(gaps) == 0:
        raise MaskError("its images are one slice: expected two at least")
    step, index = _lattice(z)
    if step is None:
        step = float(gaps.min())
        notes.append(
            f"its slices lie {1e3 * gaps.min():.3g} to {1e3 * gaps.max():.3g} mm "
            f"apart: shapes are interpolated on even ones of {1e3 * step:.3g} mm"
        )
        count = int(np.ceil((z[-1] - z[0]) / step - 1e-6)) + 1
    else:
        count = int(index[-1]) + 1
        absent = sorted(set(range(count)) - set(index.tolist()))
        if absent:
            where = ", ".join(f"{1e3 * step * k:.4g}" for k in absent[:5])
            notes.append(
                f"{len(absent)} of {count} slices are missing, {where} mm from the "
                "first: shapes are interpolated there"
            )
    between_rows, between_columns = MM * np.array(slices[0].PixelSpacing, float)
    up = (p[-1] - p[0]) / (z[-1] - z[0])  # leans where the gantry was tilted
    edges = np.column_stack(
        [between_columns * along_row, between_rows * along_column, step * up]
    )
    sizes = (int(slices[0].Columns), int(slices[0].Rows), count)
    check_sizes(sizes)
    return slices, sizes, pose(edges, p[0])


def _lattice(z: Array) -> tuple[float | None, NDArray[np.int64]]:
    """The step of even slices of which some are missing, and each one's place."""
    gaps = np.diff(z)
    usual = np.median(gaps[gaps < 1.5 * gaps.min()])
    # Gap by gap: positions are rounded, and the error of a step would add up.
    index = np.cumsum([0, *np.rint(gaps / usual)]).astype(int)
    step, first = np.polyfit(index, z, 1)
    even = np.abs(z - first - step * index).max() <= ON * step
    return (float(step) if even else None), index


# Contours ----------------------------------------------------------------------


def _planes(
    contours: list[Any], X_VP: Array, sizes: Any, name: str, notes: list[str]
) -> dict[float, Mask]:
    """What contours enclose in each plane, (nx, ny), by its place among the slices."""
    from matplotlib.path import Path as Polygon  # takes a while

    index = np.stack(np.meshgrid(*map(np.arange, sizes[:2]), indexing="ij"), -1)
    planes: dict[float, Mask] = {}
    left = 0
    for contour in contours:
        if str(contour.ContourGeometricType) not in CLOSED:
            left += 1
            continue
        points = MM * np.array(contour.ContourData, float).reshape(-1, 3)
        if not np.isfinite(points).all() or len(points) < 3:
            raise damaged(f"{name} has a contour of {len(points)} points")
        at = points @ X_VP[:3, :3].T + X_VP[:3, 3]
        k = float(at[:, 2].mean())
        if np.ptp(at[:, 2]) > 2 * ON:
            raise MaskError(
                f"{name} has a contour that spans {np.ptp(at[:, 2]):.1f} slices: "
                "expected each in the plane of one"
            )
        beyond = max(-at.min(), float((at - np.array(sizes) + 1).max()))
        if beyond > 0.5 + ON:
            raise MaskError(
                f"{name} reaches {beyond:.1f} voxels beyond the images that are "
                "there: are slices missing?"
            )
        k = next((other for other in planes if abs(other - k) <= ON), k)
        low = np.maximum(np.floor(at[:, :2].min(axis=0)).astype(int), 0)
        high = np.ceil(at[:, :2].max(axis=0)).astype(int) + 1
        box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        inner = Polygon(at[:, :2]).contains_points(index[box].reshape(-1, 2))
        plane = planes.setdefault(k, np.zeros(sizes[:2], bool))
        plane[box] ^= inner.reshape(plane[box].shape)
    if left:
        notes.append(f"{name} has {left} contours that enclose nothing")
    return planes


def _filled(
    planes: dict[float, Mask], there: Array, sizes: Any, name: str, notes: list[str]
) -> Mask:
    """The voxels of a segment.

    Args:
        planes: What is enclosed in each.
        there: Places of the slices that are there.
        sizes: Of the grid.
        name: Of the segment.
        notes: Told how many gaps were filled.
    """
    mask = np.zeros(sizes, bool)
    at = sorted(planes)
    usual = float(np.median(np.diff(at))) if len(at) > 1 else 0.0
    filled = 0
    half = max(usual, 1.0) / 2  # a plane stands for as much on both sides
    for k in at:
        first, last = (int(np.floor(k + side + 1e-6)) for side in (-half, half))
        mask[..., max(first + 1, 0) : last + 1] |= planes[k][..., None]
    for low, high in itertools.pairwise(at):
        inner = range(int(np.floor(low + ON)) + 1, int(np.ceil(high - ON)))
        drawn = ((there > low + ON) & (there < high - ON)).any()
        if not inner or (drawn and high - low > OWN * usual):
            continue
        filled += 1
        depths = [_depth(planes[low]), _depth(planes[high])]
        for k in inner:
            share = (k - low) / (high - low)
            mask[..., k] = (1.0 - share) * depths[0] + share * depths[1] > 0.0
    if filled:
        notes.append(f"{name} is interpolated in {filled} gaps between its contours")
    return mask


def _depth(mask: Mask) -> Array:
    """Distance of pixels to a shape's border, negative outside."""
    if not mask.any():
        return np.full(mask.shape, -1.0)
    from scipy import ndimage  # takes a while

    inner, outer = map(ndimage.distance_transform_edt, (mask, ~mask))
    depth: Array = inner - outer
    return depth
