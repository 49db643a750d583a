"""Files that outlive a program killed in the middle of writing them.

Each carries a digest of its content, so a damaged one is recognised, and the file
that it replaces is kept beside it.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import errno
import hashlib
import io
import json
import os
from pathlib import Path
import stat
from typing import Any

import numpy as np

MAGIC = b"trocar-archive-1"

type Arrays = Mapping[str, tuple[str, tuple[int | str, ...]]]
"""Of each array its kind, as numpy's `dtype.str` ends, and its lengths; a length that
is a name is the same wherever the name stands."""


def before(path: Path) -> Path:
    """Where the file before this one is kept."""
    return path.with_name(path.name + ".before")


def beside(path: Path, what: str) -> Path:
    """Where what belongs to a file is kept, by its name."""
    return path.with_name(f"{path.name}.{what}")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Writes a file that is there whole or not at all.

    Yields:
        Where to write; at the end it takes the path's place, after an error it goes.
    """
    draft = beside(path, "draft")
    try:
        yield draft
        with draft.open("rb") as stream:
            os.fsync(stream.fileno())
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)


def read_regular(path: Path, most: int) -> bytes:
    """What a regular file holds; nothing else is waited for, or read without end.

    Raises:
        OSError: If it cannot be read, is a folder, a pipe or a device, or is larger
            than `most` bytes.
    """

    def at_once(name: str, flags: int) -> int:  # a pipe is waited for otherwise
        return os.open(name, flags | os.O_NONBLOCK)

    with open(path, "rb", opener=at_once) as stream:
        about = os.fstat(stream.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, "no regular file")
        if about.st_size > most:
            reason = f"{about.st_size} bytes, expected at most {most}"
            raise OSError(errno.EFBIG, reason)
        return stream.read(most)


def write_archive(path: Path, meta: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Writes plain data and arrays; the file before is kept as `*.before`.

    At no instant is there no whole file.
    """
    buffer = io.BytesIO()
    np.savez_compressed(buffer, meta=np.array(json.dumps(meta)), **arrays)
    content = buffer.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as draft:
        draft.write_bytes(MAGIC + hashlib.sha256(content).digest() + content)
        if path.exists():
            os.replace(path, before(path))


@contextmanager
def sensible(path: Path, what: str) -> Iterator[None]:
    """What does not fit in this context is refused as the file's nonsense.

    Raises:
        ValueError: The file is named.
    """
    try:
        yield
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        told = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"{what} {str(path)!r} makes no sense: {told}") from error


def check_arrays(arrays: Mapping[str, Any], expected: Arrays) -> None:
    """Holds arrays against what they should be; all numbers must be finite.

    Raises:
        ValueError: For the first that is not so.
    """
    lengths: dict[str, int] = {}
    for name, (kind, shape) in expected.items():
        array = arrays[name]
        told = f"{name} is {array.dtype.str[1:]} {array.shape}"
        if array.ndim != len(shape):
            raise ValueError(f"{told}, expected {kind} {shape}")
        wanted = tuple(
            lengths.setdefault(length, found) if isinstance(length, str) else length
            for length, found in zip(shape, array.shape, strict=True)
        )
        if array.dtype.str[1:] != kind or array.shape != wanted:
            raise ValueError(f"{told}, expected {kind} {wanted}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds numbers that are not finite")


def read_archive(
    path: Path, what: str, version: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Plain data and arrays of a file.

    Args:
        path: The file.
        what: What it is, for messages.
        version: Its `format`.

    Raises:
        ValueError: If it is not there or damaged, and a whole one before it is
            offered; or if it is of another version.
    """
    earlier, offer = before(path), ""
    if earlier.is_file() and _content(earlier) is not None:
        offer = f"; the one before it is whole: {earlier}"
    if not path.is_file():
        raise ValueError(f"no {what} {str(path)!r}{offer}")
    content = _content(path)
    if content is None:
        raise ValueError(f"{what} {str(path)!r} is damaged{offer}")
    with np.load(io.BytesIO(content), allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files}
    meta = json.loads(str(arrays.pop("meta")))
    found = meta.get("format")
    if found != version:
        raise ValueError(
            f"{what} {str(path)!r} has format {found}, expected {version}: it was made "
            "by another version; make it anew"
        )
    return meta, arrays


def _content(path: Path) -> bytes | None:
    """What a file holds, or None if it is damaged."""
    raw = path.read_bytes()
    start = len(MAGIC) + 32
    whole = raw[:start] == MAGIC + hashlib.sha256(raw[start:]).digest()
    return raw[start:] if whole and len(raw) > start else None
