"""MetaImage, the format of ITK: .mha, or .mhd with its data beside it."""

from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import (
    UNITS,
    UNPLACED,
    UNTURNED,
    Image,
    MaskError,
    beside,
    choice,
    damaged,
    header_lines,
    numbers,
    pose,
    read_values,
    three_sizes,
)

TYPES = {
    "MET_CHAR": "i1",
    "MET_UCHAR": "u1",
    "MET_SHORT": "i2",
    "MET_USHORT": "u2",
    "MET_INT": "i4",
    "MET_UINT": "u4",
    "MET_LONG_LONG": "i8",
    "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}
TRUTH = {"True": True, "False": False}


def read_meta_image(path: Path) -> Image:
    """Reads MetaImage.

    Raises:
        MaskError: If it is damaged, or no scalar image of three axes.
    """
    lines, offset = header_lines(path, lambda line: line.startswith("ElementDataFile"))
    fields = _fields(lines)
    (axes,) = numbers(fields["NDims"], 1, "NDims")
    (channels,) = numbers(fields.get("ElementNumberOfChannels", "1"), 1, "Channels")
    if (axes, channels) != (3, 1):
        raise MaskError(
            f"it has {axes:g} axes and {channels:g} values a voxel: expected 3 and 1"
        )
    if fields.get("HeaderSize", "0") != "0":
        raise MaskError(f"MetaImage with HeaderSize {fields['HeaderSize'][:9]}")
    dtype = np.dtype(choice(fields["ElementType"], TYPES, "ElementType"))
    for key in ("BinaryDataByteOrderMSB", "ElementByteOrderMSB"):
        if choice(fields.get(key, "False"), TRUTH, key):
            dtype = dtype.newbyteorder(">")
    file = path
    if fields["ElementDataFile"] != "LOCAL":
        file, offset = beside(path, fields["ElementDataFile"]), 0
    encoding = "text"
    if choice(fields.get("BinaryData", "False"), TRUTH, "BinaryData"):
        encoding = "raw"
        if choice(fields.get("CompressedData", "False"), TRUTH, "CompressedData"):
            encoding = "deflated"
            stored = str(max(file.stat().st_size - offset, 0))
            if fields.get("CompressedDataSize", stored) != stored:
                raise damaged(f"it has {stored} bytes of data, its header differs")
    notes: list[str] = []
    X_PV = _pose(fields, notes)
    sizes = three_sizes(fields["DimSize"], "DimSize")
    return Image(read_values(file, offset, sizes, dtype, encoding), X_PV, notes)


def _fields(lines: list[str]) -> dict[str, str]:
    fields: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        key, equals, value = line.partition("=")
        key = key.strip()
        if not equals or not re.fullmatch("[ -~]+", key) or key in fields:
            raise damaged(f"line {number} of its header is no field of MetaImage")
        fields[key] = value.strip()
    for key in ("NDims", "DimSize", "ElementType", "ElementDataFile"):
        if key not in fields:
            raise damaged(f"its header has no {key}")
    return fields


def _pose(fields: dict[str, str], notes: list[str]) -> NDArray[np.float64]:
    def found(count: int, *keys: str) -> NDArray[np.float64] | None:
        there = [key for key in keys if key in fields]
        return numbers(fields[there[0]], count, there[0]) if there else None

    spacing = found(3, "ElementSpacing", "ElementSize")
    matrix = found(9, "TransformMatrix", "Rotation", "Orientation")
    origin = found(3, "Offset", "Position", "Origin")
    if spacing is None:
        raise MaskError("MetaImage without ElementSpacing: how large are its voxels?")
    if matrix is None:
        matrix = np.eye(3).ravel()
        notes.append(UNTURNED)
    if origin is None:
        origin = np.zeros(3)
        notes.append(UNPLACED)
    axes = matrix.reshape(3, 3).T  # the file's rows
    if np.abs(np.linalg.norm(axes, axis=0) - 1.0).max() > 0.01:
        raise damaged("its TransformMatrix is no rotation")
    unit = choice(fields.get("DistanceUnits", "mm"), UNITS, "DistanceUnits")
    return pose(unit * axes * spacing, unit * origin)
