"""Images as files hold them: what NRRD, MetaImage and NIfTI have in common.

A header is parsed strictly, and says how long the data must be before any memory is
asked for: what is cut, padded or fails its checksum is damaged.

Frame P is LPS: x to the patient's left, y to the back, z to the head. Files in RAS are
turned into it.
"""

import bz2
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any
import zlib

import numpy as np
from numpy.typing import NDArray

MOST_VOXELS = 2**28
"""As many as 1024 slices of 512 x 512 have."""

MOST_HEADER = 2**20
"""Longest header in bytes."""

RAS = np.diag([-1.0, -1.0, 1.0])
"""From right-anterior-superior to LPS."""

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "micron": 1e-6, "microns": 1e-6}
"""Lengths that files name, in m."""

UNTURNED = "it says nothing of its directions: they are taken for LPS"
UNPLACED = "it says nothing of its place: its first voxel is taken for the origin"


class MaskError(ValueError):
    """A mask that is no mask."""


@dataclass
class Image:
    """A scalar image of three axes.

    Attributes:
        values: As the file has them, (nx, ny, nz).
        X_PV: From voxel indices (i, j, k, 1) to positions in P in m, (4, 4).
        notes: What had to be assumed.
    """

    values: NDArray
    X_PV: NDArray[np.float64]
    notes: list[str] = field(default_factory=list)


def damaged(why: str) -> MaskError:
    """The error of a file that is not as it was written."""
    return MaskError(f"the file is damaged: {why}")


# Data --------------------------------------------------------------------------


def read_values(
    file: Path, offset: int, sizes: Sequence[int], dtype: np.dtype, encoding: str
) -> NDArray:
    """The values that lie in a file, (nx, ny, nz).

    Args:
        file: Where they are, up to its end.
        offset: Their first byte.
        sizes: nx, ny, nz.
        dtype: Of a value, with its byte order.
        encoding: "raw", "deflated", "bzip2", "text" or "hex".

    Raises:
        MaskError: If the file has more or fewer, or fails a checksum.
    """
    length = check_sizes(sizes) * dtype.itemsize
    data = read_some(file, length, offset)
    if encoding == "text":
        return _text(data, sizes)
    if encoding == "deflated":
        data = inflate(data, length)
    elif encoding == "bzip2":
        data = _expand(bz2.BZ2Decompressor, data, length)
    elif encoding == "hex":
        try:
            data = bytes.fromhex(data.decode("ascii"))
        except ValueError:
            raise damaged("its data are no hexadecimal digits") from None
    return shaped(data, 0, sizes, dtype)


def read_some(file: Path, length: int, offset: int = 0) -> bytes:
    """Bytes of a file from an offset on; no more than could ever mean so many."""
    with file.open("rb") as stream:
        stream.seek(offset)
        return stream.read(4 * length + MOST_HEADER)  # as text, or badly packed


def shaped(data: bytes, offset: int, sizes: Sequence[int], dtype: np.dtype) -> NDArray:
    """Values out of bytes, x fastest, (nx, ny, nz)."""
    length = offset + math.prod(sizes) * dtype.itemsize
    if len(data) != length:
        raise damaged(f"it has {len(data)} bytes of data, its header says {length}")
    return np.frombuffer(data, dtype, offset=offset).reshape(sizes, order="F")


def check_sizes(sizes: Sequence[int]) -> int:
    """How many voxels an image has; absurdly many are refused."""
    if min(sizes) < 1:
        raise damaged(f"sizes of {shown(sizes)}")
    if math.prod(sizes) > MOST_VOXELS:
        raise MaskError(
            f"{shown(sizes)} voxels: expected at most {MOST_VOXELS}, 512 x 512 x 1024;"
            " crop it to the tumour and what is critical"
        )
    return math.prod(sizes)


def inflate(data: bytes, length: int) -> bytes:
    """So many bytes out of gzip's or zlib's, checksums included."""
    return _expand(lambda: zlib.decompressobj(47), data, length)


def _expand(decompressor: Callable[[], Any], data: bytes, length: int) -> bytes:
    whole = b""
    while data:
        part = decompressor()
        try:
            whole += part.decompress(data, length + 1 - len(whole))
        except (zlib.error, OSError):
            raise damaged("its compressed data fail their check") from None
        if len(whole) > length:
            raise damaged(f"it has more than the {length} bytes of its header")
        if not part.eof:
            raise damaged("its compressed data are cut")
        # Files of several members, and ones padded with zeros, are whole.
        data = part.unused_data.lstrip(b"\0")
    return whole


def _text(data: bytes, sizes: Sequence[int]) -> NDArray:
    words = data.split()
    if len(words) != math.prod(sizes):
        raise damaged(f"it has {len(words)} numbers, its header says {shown(sizes)}")
    try:
        values = np.array(words).astype(float)
    except ValueError:
        raise damaged("its data are no numbers") from None
    return values.reshape(sizes, order="F")


# Headers of text ---------------------------------------------------------------


def header_lines(path: Path, last: Callable[[str], bool]) -> tuple[list[str], int]:
    """Lines of a header up to its last, and where the data after it begin."""
    with path.open("rb") as stream:
        data = stream.read(MOST_HEADER)
    lines, start = [], 0
    while start < len(data):
        stop = data.find(b"\n", start)
        stop = len(data) if stop < 0 else stop
        lines.append(data[start:stop].decode("latin-1").rstrip("\r"))
        start = stop + 1
        if last(lines[-1]):
            break
    return lines, start


def beside(path: Path, name: str) -> Path:
    """A header's detached data, which must lie in the header's own folder."""
    folder = path.resolve().parent
    data = folder / name
    is_name = Path(name).name == name and name.isprintable()
    if not is_name or data.resolve().parent != folder:
        raise MaskError(
            f"its data file {name[:80]!r}: expected a file in the header's own folder"
        )
    if not data.is_file():
        raise MaskError(f"its data file {name[:80]!r} is not there")
    return data


def numbers(text: str, count: int, key: str) -> NDArray[np.float64]:
    """So many finite numbers of a header's field."""
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.empty(0)
    if len(found) != count or not np.isfinite(found).all() or "_" in text:
        raise damaged(f"{key}: {text[:80]!r}, expected {count} numbers")
    return found


def three_sizes(text: str, key: str) -> list[int]:
    """The sizes of three axes."""
    if not re.fullmatch(r"[0-9]{1,9}( +[0-9]{1,9}){2}", text):
        raise damaged(f"{key}: {text[:80]!r}, expected three whole numbers")
    return [int(word) for word in text.split()]


def choice(text: str, choices: dict[str, Any], key: str) -> Any:
    """What a word of a header's field means."""
    if text not in choices:
        raise MaskError(f"{key}: {text[:40]!r}, expected one of {', '.join(choices)}")
    return choices[text]


def shown(values: Any) -> str:
    """Sizes or lengths along axes, as text."""
    return " x ".join(f"{value:g}" for value in values)


def pose(edges: NDArray, origin: NDArray) -> NDArray[np.float64]:
    """X_PV of a voxel's edges (its columns) and the first voxel's centre, in m."""
    spacing = np.linalg.norm(edges, axis=0)
    if not ((spacing > 1e-9) & (spacing < 1e3)).all():
        raise MaskError(
            f"spacing of {shown(1e3 * spacing)} mm: voxels must be longer than zero "
            "along all three axes"
        )
    if not (np.abs(origin) < 1e6).all():
        raise MaskError(f"its first voxel lies at {origin.tolist()} m")
    axes = edges / spacing
    lean = float(np.abs(axes.T @ axes - np.eye(3)).max())
    if lean > 0.01:
        raise MaskError(
            f"its axes lean by {math.degrees(math.asin(min(lean, 1.0))):.1f} degrees: "
            "expected right angles; resample it (a scanner's gantry may be tilted)"
        )
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = edges, origin
    return X
