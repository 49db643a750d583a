"""NIfTI-1 and NIfTI-2 in one file, packed or not."""

import math
from pathlib import Path
from typing import Any
import zlib

import numpy as np
from numpy.typing import NDArray

from plants.tissue.image import (
    MOST_HEADER,
    RAS,
    Image,
    MaskError,
    check_sizes,
    damaged,
    inflate,
    pose,
    read_some,
    shaped,
    shown,
)

AUTO, QFORM, SFORM = "auto", "qform", "sform"
TRANSFORMS = (AUTO, QFORM, SFORM)
"""Which transform is taken. AUTO is the one there is; of two the qform, which never
leads into an atlas."""

TYPES = {
    2: "u1",
    4: "i2",
    8: "i4",
    16: "f4",
    64: "f8",
    256: "i1",
    512: "u2",
    768: "u4",
    1024: "i8",
    1280: "u8",
}
UNITS = {0: 1e-3, 1: 1.0, 2: 1e-3, 3: 1e-6}
"""Unknown (taken for mm), metre, mm, micrometre; in m."""

MAGIC = {348: (b"n+1\0", 344), 540: (b"n+2\0", 4)}
"""What stands where, by the length that a header begins with."""

HEADERS = {
    348: {
        "dim": ("i2", (8,), 40),
        "datatype": ("i2", (), 70),
        "bitpix": ("i2", (), 72),
        "pixdim": ("f4", (8,), 76),
        "vox_offset": ("f4", (), 108),
        "scl_slope": ("f4", (), 112),
        "scl_inter": ("f4", (), 116),
        "xyzt_units": ("u1", (), 123),
        "qform_code": ("i2", (), 252),
        "sform_code": ("i2", (), 254),
        "quatern": ("f4", (3,), 256),
        "qoffset": ("f4", (3,), 268),
        "srow": ("f4", (3, 4), 280),
    },
    540: {
        "datatype": ("i2", (), 12),
        "bitpix": ("i2", (), 14),
        "dim": ("i8", (8,), 16),
        "pixdim": ("f8", (8,), 104),
        "vox_offset": ("i8", (), 168),
        "scl_slope": ("f8", (), 176),
        "scl_inter": ("f8", (), 184),
        "qform_code": ("i4", (), 344),
        "sform_code": ("i4", (), 348),
        "quatern": ("f8", (3,), 352),
        "qoffset": ("f8", (3,), 376),
        "srow": ("f8", (3, 4), 400),
        "xyzt_units": ("i4", (), 500),
    },
}
"""Kind, shape and place of the fields."""


def read_nifti(path: Path, transform: str = AUTO) -> Image:
    """Reads NIfTI.

    Args:
        path: The file.
        transform: One of `TRANSFORMS`.

    Raises:
        MaskError: If it is damaged, or no scalar image of three axes.
    """
    head = read_some(path, 0)
    packed = head[:2] == b"\x1f\x8b"
    h, order = _header(_begin(head) if packed else head)
    dim = h["dim"].tolist()
    if not 1 <= dim[0] <= 7:
        raise damaged(f"it has {dim[0]} axes")
    sizes, more = dim[1:4], dim[4 : dim[0] + 1]
    if dim[0] < 3 or any(size != 1 for size in more):
        raise MaskError(f"it has sizes {shown(dim[1 : dim[0] + 1])}: expected 3 axes")
    code, bits, start = int(h["datatype"]), int(h["bitpix"]), float(h["vox_offset"])
    if code not in TYPES:
        raise MaskError(f"NIfTI of datatype {code}: expected one real number a voxel")
    dtype = np.dtype(order + TYPES[code])
    placed = start.is_integer() and h.nbytes <= start <= MOST_HEADER
    if bits != 8 * dtype.itemsize or not placed:
        raise damaged(f"datatype {code} of {bits} bits, data from byte {start:g} on")
    notes: list[str] = []
    X_PV = _pose(h, transform, notes)
    length = int(start) + check_sizes(sizes) * dtype.itemsize
    data = read_some(path, length)
    values = shaped(inflate(data, length) if packed else data, int(start), sizes, dtype)
    slope, inter = float(h["scl_slope"]), float(h["scl_inter"])
    if slope != 0.0 and (slope, inter) != (1.0, 0.0):
        if not (math.isfinite(slope) and math.isfinite(inter)):
            raise damaged(f"its values are scaled by {slope:g} and {inter:g}")
        values = slope * values.astype(float) + inter
    return Image(values, X_PV, notes)


def _begin(data: bytes) -> bytes:
    try:
        return zlib.decompressobj(31).decompress(data, 540)
    except zlib.error:
        raise damaged("its compressed data fail their check") from None


def _header(data: bytes) -> tuple[Any, str]:
    """The header's fields, and the byte order of the file."""
    for order in "<>":
        length = int(np.frombuffer(data[:4].ljust(4, b"\0"), order + "i4")[0])
        if length in HEADERS and len(data) >= length:
            magic, place = MAGIC[length]
            found = data[place : place + 4]
            if found == b"ni" + magic[2:]:
                raise MaskError("NIfTI of two files: save it as one, .nii.gz")
            if found == magic:
                fields = HEADERS[length]
                header = np.dtype(
                    {
                        "names": list(fields),
                        "formats": [(order + k, n) for k, n, _ in fields.values()],
                        "offsets": [place for _, _, place in fields.values()],
                        "itemsize": length,
                    }
                )
                return np.frombuffer(data, header, 1)[0], order
    raise damaged("it does not begin as NIfTI does")


def _pose(h: Any, transform: str, notes: list[str]) -> NDArray[np.float64]:
    unit = UNITS.get(int(h["xyzt_units"]) & 7)
    if unit is None:
        raise damaged("its unit of length is none of NIfTI's")
    spacing = h["pixdim"][1:4].astype(float)
    poses = {}
    if h["qform_code"] > 0:
        poses[QFORM] = _qform(h, spacing)
    if h["sform_code"] > 0:
        poses[SFORM] = h["srow"].astype(float)
    if transform not in (AUTO, *poses):
        raise MaskError(
            f"labels.transform={transform}: it has {' and '.join(poses) or 'neither'};"
            " expected auto"
        )
    if not poses:
        poses[AUTO] = np.column_stack([np.diag(spacing), np.zeros(3)])
        notes.append("it says nothing of its directions: they are taken for RAS")
    if not all(np.isfinite(X).all() and np.abs(X).max() < 1e9 for X in poses.values()):
        raise damaged("its transform holds what is no length")
    if transform == AUTO:
        transform = next(iter(poses))
        if len(poses) == 2:
            _compare(poses, h["dim"][1:4], spacing, unit, notes)
    X = unit * RAS @ poses[transform]
    return pose(X[:, :3], X[:, 3])


def _qform(h: Any, spacing: NDArray) -> NDArray[np.float64]:
    """The pose told by a quaternion, (3, 4)."""
    b, c, d = h["quatern"].astype(float)
    rest = 1.0 - (b * b + c * c + d * d)
    if not (rest > -1e-4 and (spacing > 0.0).all()):
        raise damaged("its qform is no rotation")
    a = math.sqrt(max(rest, 0.0))
    R = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ]
    )
    if h["pixdim"][0] < 0.0:
        R[:, 2] *= -1.0
    return np.column_stack([R * spacing, h["qoffset"].astype(float)])


def _compare(
    poses: dict[str, NDArray], sizes: NDArray, spacing: NDArray, unit: float, notes: Any
) -> None:
    """Notes how far two transforms put a corner of the image apart."""
    corners = np.stack(np.meshgrid(*((0, size - 1) for size in sizes), [1]), -1)
    apart = corners.reshape(-1, 4) @ (poses[QFORM] - poses[SFORM]).T
    worst = float(np.linalg.norm(apart, axis=1).max())
    if worst > 0.1 * spacing.min():
        notes.append(
            f"its qform and sform lie up to {1e3 * unit * worst:.3g} mm apart: the "
            "qform is taken; choose with labels.transform=qform or sform"
        )
