"""NRRD, the format of 3D Slicer and of teem: one file, or a header and its data."""

from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import (
    RAS,
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
    name: code
    for code, names in {
        "i1": "signed char, int8, int8_t",
        "u1": "uchar, unsigned char, uint8, uint8_t",
        "i2": "short, short int, signed short, signed short int, int16, int16_t",
        "u2": "ushort, unsigned short, unsigned short int, uint16, uint16_t",
        "i4": "int, signed int, int32, int32_t",
        "u4": "uint, unsigned int, uint32, uint32_t",
        "i8": "longlong, long long, long long int, signed long long, "
        "signed long long int, int64, int64_t",
        "u8": "ulonglong, unsigned long long, unsigned long long int, uint64, uint64_t",
        "f4": "float",
        "f8": "double",
    }.items()
    for name in names.split(", ")
}
ENCODINGS = {
    "raw": "raw",
    "gzip": "deflated",
    "gz": "deflated",
    "bzip2": "bzip2",
    "bz2": "bzip2",
    "text": "text",
    "txt": "text",
    "ascii": "text",
    "hex": "hex",
}
ENDIANS = {"little": "<", "big": ">"}
SPACES = {
    "left-posterior-superior": np.eye(3),
    "lps": np.eye(3),
    "right-anterior-superior": RAS,
    "ras": RAS,
    "left-anterior-superior": np.diag([1.0, -1.0, 1.0]),
    "las": np.diag([1.0, -1.0, 1.0]),
}
"""From a space to LPS."""

FIELDS = (
    "dimension type blocksize encoding endian content min max oldmin oldmax lineskip "
    "byteskip number sampleunits sizes spacings thicknesses axismins axismaxs centers "
    "centerings labels units kinds space spacedimension spaceunits spaceorigin "
    "spacedirections measurementframe datafile"
)
"""All that NRRD knows, without blanks: a field misspelt by damage is not passed by."""


def read_nrrd(path: Path) -> Image:
    """Reads NRRD.

    Raises:
        MaskError: If it is damaged, or no scalar image of three axes.
    """
    lines, offset = header_lines(path, lambda line: line == "")
    fields = _fields(lines)
    (axes,) = numbers(fields["dimension"], 1, "dimension")
    if axes != 3:
        raise MaskError(
            f"it has {axes:g} axes: expected 3; export overlapping segments as one "
            "label map"
        )
    for key in ("lineskip", "byteskip"):
        if fields.get(key, "0") != "0":
            raise MaskError(f"NRRD with {key} {fields[key][:9]}: expected 0")
    for kind in fields.get("kinds", "").split():
        if kind.lower() not in ("domain", "space", "none", "???"):
            raise MaskError(f"NRRD with an axis of kind {kind[:20]!r}: expected domain")
    dtype = np.dtype(choice(fields["type"].lower(), TYPES, "NRRD type"))
    encoding = choice(fields["encoding"].lower(), ENCODINGS, "NRRD encoding")
    if dtype.itemsize > 1 and encoding != "text":
        endian = fields.get("endian", "").lower()
        dtype = dtype.newbyteorder(choice(endian, ENDIANS, "NRRD endian"))
    file = path
    if "datafile" in fields:
        file, offset = beside(path, fields["datafile"]), 0
    elif path.name.lower().endswith(".nhdr"):
        raise damaged("it names no data file")
    notes: list[str] = []
    X_PV = _pose(fields, notes)
    sizes = three_sizes(fields["sizes"], "sizes")
    return Image(read_values(file, offset, sizes, dtype, encoding), X_PV, notes)


def _fields(lines: list[str]) -> dict[str, str]:
    if not lines or not re.fullmatch("NRRD000[1-5]", lines[0]):
        raise damaged("it does not begin as NRRD does")
    fields: dict[str, str] = {}
    for number, line in enumerate(lines[1:], 2):
        if line == "" or line.startswith("#") or re.match("[^:]*:=", line):
            continue
        key, colon, value = line.partition(": ")
        key = key.lower().replace(" ", "")
        if not colon or key not in FIELDS.split() or key in fields:
            raise damaged(f"line {number} of its header is no field of NRRD")
        fields[key] = value.strip()
    for key in ("dimension", "type", "encoding", "sizes"):
        if key not in fields:
            raise damaged(f"its header has no {key}")
    return fields


def _pose(fields: dict[str, str], notes: list[str]) -> NDArray[np.float64]:
    told = fields.get("spaceunits", fields.get("units", ""))
    units = set(re.findall(r'"([^"]+)"', told)) or {"mm"}
    if len(units) > 1:
        raise MaskError(f"NRRD whose axes have several units, {sorted(units)}")
    unit = choice(units.pop(), UNITS, "NRRD unit")
    turn = np.eye(3)
    if "spacedirections" in fields:
        space = fields.get("space", "none")
        if space.lower() in SPACES:
            turn = SPACES[space.lower()]
        else:
            notes.append(f"its space ({space[:40]}) is taken for LPS")
        edges = _vectors(fields["spacedirections"], 3, "space directions").T
    elif "spacings" in fields:
        edges = np.diag(numbers(fields["spacings"], 3, "spacings"))
        notes.append(UNTURNED)
    else:
        raise MaskError("NRRD without space directions: how large are its voxels?")
    origin = np.zeros(3)
    if "spaceorigin" in fields:
        origin = _vectors(fields["spaceorigin"], 1, "space origin")[0]
    elif "axismins" in fields:
        origin = numbers(fields["axismins"], 3, "axis mins")
    else:
        notes.append(UNPLACED)
    return pose(unit * turn @ edges, unit * turn @ origin)


def _vectors(text: str, count: int, key: str) -> NDArray[np.float64]:
    words = re.findall(r"\(([^()]*)\)", text)
    if len(words) != count or re.sub(r"\([^()]*\)|\s", "", text):
        raise damaged(f"{key}: {text[:80]!r}, expected {count} x (x,y,z)")
    return np.array([numbers(word.replace(",", " "), 3, key) for word in words])
