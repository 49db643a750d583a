"""DICOM as test files: a CT, and what was segmented or drawn on it."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import contourpy
import highdicom
import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sr.codedict import codes
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

CT = "1.2.840.10008.5.1.4.1.1.2"
RTSTRUCT = "1.2.840.10008.5.1.4.1.1.481.3"
CLOSED = "CLOSED_PLANAR"


def made(kind: str, modality: str, **values: Any) -> Dataset:
    """A data set of a class, with what every patient's has."""
    ds = Dataset()
    ds.SOPClassUID, ds.SOPInstanceUID = kind, generate_uid()
    ds.Modality = modality
    for key in ("PatientID", "PatientName", "PatientBirthDate", "PatientSex"):
        setattr(ds, key, "")
    for key in ("StudyDate", "StudyTime", "StudyID", "AccessionNumber"):
        setattr(ds, key, "")
    ds.ReferringPhysicianName = ""
    for key, value in values.items():
        setattr(ds, key, value)
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = kind
    meta.MediaStorageSOPInstanceUID = ds.SOPInstanceUID
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    ds.file_meta = meta
    return ds


def slices(
    sizes: Any, spacing: Any, direction: Any, origin: Any, places: Any = None
) -> list[Dataset]:
    """A CT's slices, in mm; `places` are theirs along the normal, from the origin."""
    R, first = np.asarray(direction, float), np.asarray(origin, float)
    if places is None:
        places = spacing[2] * np.arange(sizes[2])
    own = {key: generate_uid() for key in ("StudyInstanceUID", "SeriesInstanceUID")}
    own["FrameOfReferenceUID"] = generate_uid()
    found = []
    for number, place in enumerate(places):
        ds = made(CT, "CT", **own, InstanceNumber=number + 1, SeriesNumber=1)
        ds.Rows, ds.Columns = sizes[1], sizes[0]
        ds.PixelSpacing = [f"{spacing[1]:.9g}", f"{spacing[0]:.9g}"]
        ds.SliceThickness = spacing[2]
        ds.ImageOrientationPatient = [f"{v:.12g}" for v in R.T[:2].ravel()]
        ds.ImagePositionPatient = [f"{v:.12g}" for v in first + place * R[:, 2]]
        ds.BitsAllocated, ds.BitsStored, ds.HighBit = 16, 16, 15
        ds.SamplesPerPixel, ds.PixelRepresentation = 1, 0
        ds.PhotometricInterpretation = "MONOCHROME2"
        found.append(ds)
    return found


def write(folder: Path, images: Iterable[Dataset]) -> None:
    """Writes slices, in no order of theirs."""
    folder.mkdir(exist_ok=True)
    for n, ds in enumerate(sorted(images, key=lambda ds: ds.SOPInstanceUID)):
        ds.save_as(folder / f"{n:03d}", enforce_file_format=True)


def write_seg(
    path: Path,
    ct: list[Dataset],
    segments: dict[str, np.ndarray],
    kind: str = "BINARY",
    **more: Any,
) -> Path:
    """Writes segments, each (nx, ny, nz), by name."""
    pixels = np.stack([mask.transpose(2, 1, 0) for mask in segments.values()], -1)
    described = [
        highdicom.seg.SegmentDescription(
            number,
            name,
            codes.SCT.MorphologicallyAbnormalStructure,
            codes.SCT.Neoplasm,
            highdicom.seg.SegmentAlgorithmTypeValues.MANUAL,
        )
        for number, name in enumerate(segments, 1)
    ]
    own = [generate_uid(), 2, generate_uid(), 1, "trocar", "tests", "1", "1"]
    highdicom.seg.Segmentation(ct, pixels, kind, described, *own, **more).save_as(path)
    return path


def write_structures(
    path: Path,
    ct: list[Dataset],
    names: list[str],
    contours: list[list[tuple[np.ndarray, Dataset, str]]],
) -> Path:
    """Writes contours by segment: points (n, 3) in mm, slice, type."""
    ds = made(RTSTRUCT, "RTSTRUCT", StructureSetLabel="S")
    ds.StudyInstanceUID, ds.SeriesInstanceUID = ct[0].StudyInstanceUID, generate_uid()
    frame, study, series = Dataset(), Dataset(), Dataset()
    series.SeriesInstanceUID = ct[0].SeriesInstanceUID
    study.RTReferencedSeriesSequence = [series]
    frame.FrameOfReferenceUID = ct[0].FrameOfReferenceUID
    frame.RTReferencedStudySequence = [study]
    ds.ReferencedFrameOfReferenceSequence = [frame]
    ds.StructureSetROISequence, ds.ROIContourSequence = [], []
    for number, (name, drawn) in enumerate(zip(names, contours, strict=True), 1):
        roi, lines = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName = number, name
        lines.ReferencedROINumber = number
        lines.ContourSequence = []
        for points, image, kind in drawn:
            line, shown = Dataset(), Dataset()
            shown.ReferencedSOPClassUID = CT
            shown.ReferencedSOPInstanceUID = image.SOPInstanceUID
            line.ContourImageSequence = [shown]
            line.ContourGeometricType = kind
            line.NumberOfContourPoints = len(points)
            line.ContourData = [f"{v:.9g}" for v in np.ravel(points)]
            lines.ContourSequence.append(line)
        ds.StructureSetROISequence.append(roi)
        ds.ROIContourSequence.append(lines)
    ds.save_as(path, enforce_file_format=True)
    return path


def outlines(
    mask: np.ndarray, ct: list[Dataset], only: Any = None
) -> list[tuple[np.ndarray, Dataset, str]]:
    """What surrounds a mask (nx, ny, nz), and its holes, in the slices of a CT."""
    found = []
    for k, image in enumerate(ct):
        if only is not None and k not in only:
            continue
        row, column = np.array(image.ImageOrientationPatient, float).reshape(2, 3)
        dy, dx = map(float, image.PixelSpacing)
        plane = np.pad(mask[..., k].T.astype(float), 1)  # (y, x)
        for line in contourpy.contour_generator(z=plane).lines(0.5):
            x, y = line[:-1].T - 1.0
            p = np.outer(x * dx, row) + np.outer(y * dy, column)
            found.append((p + np.array(image.ImagePositionPatient), image, CLOSED))
    return found
