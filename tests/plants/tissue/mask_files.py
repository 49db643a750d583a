"""Masks as test files: written by ITK, or by hand where ITK does not write them."""

from pathlib import Path
import struct
from typing import Any

import numpy as np
import SimpleITK as sitk

TURN = np.linalg.qr(np.array([[3.0, 1.0, 0.5], [-1.0, 3.0, 0.2], [0.3, -0.7, 2.5]]))[0]
"""A rotation that leaves no axis where it was."""


def write_mask(
    path: Path,
    labels: np.ndarray,
    spacing: Any = (1.0, 1.0, 1.0),
    direction: Any = None,
    origin: Any = (0.0, 0.0, 0.0),
    compressed: bool = True,
) -> Path:
    """Writes labels (x, y, z) as an image, in mm and LPS."""
    image = sitk.GetImageFromArray(np.ascontiguousarray(labels.transpose(2, 1, 0)))
    image.SetSpacing(list(map(float, spacing)))
    axes = np.eye(3) if direction is None else np.asarray(direction, float)
    image.SetDirection(axes.ravel().tolist())
    image.SetOrigin(list(map(float, origin)))
    sitk.WriteImage(image, str(path), compressed)
    return path


def ellipsoid(sizes: Any = (24, 22, 10), label: int = 1) -> np.ndarray:
    """An ellipsoid that fills most of an image, (nx, ny, nz)."""
    index = np.stack(np.meshgrid(*map(np.arange, sizes), indexing="ij"), -1)
    middle = (np.array(sizes) - 1) / 2
    away = (index - middle) / (0.8 * middle)
    return ((away**2).sum(-1) <= 1.0).astype(np.uint8) * np.uint8(label)


def nifti_header(
    sizes: Any,
    order: str = "<",
    datatype: tuple[int, int] = (2, 8),
    spacing: Any = (1.0, 1.0, 1.0),
    units: int = 2,
    qform: Any = None,
    sform: Any = None,
    scale: Any = (1.0, 0.0),
) -> bytes:
    """A NIfTI-1 header: qform as (b, c, d, x, y, z), sform as (3, 4)."""
    head = bytearray(352)

    def put(place: int, kind: str, *values: Any) -> None:
        struct.pack_into(f"{order}{len(values)}{kind}", head, place, *values)

    put(0, "i", 348)
    put(40, "h", 3, *sizes, 1, 1, 1, 1)
    put(70, "h", *datatype)
    put(76, "f", 1.0, *spacing)
    put(108, "f", 352.0, *scale)
    head[123] = units
    put(252, "h", int(qform is not None), int(sform is not None))
    put(256, "f", *(qform or [0.0] * 6))
    put(280, "f", *np.ravel(np.zeros((3, 4)) if sform is None else sform))
    head[344:348] = b"n+1\0"
    return bytes(head)


def flat(labels: np.ndarray, dtype: Any = None) -> bytes:
    """Voxels with x fastest."""
    return np.asarray(labels, dtype or labels.dtype).tobytes(order="F")
