"""Files that outlive a program killed in the middle of writing them.

Each carries a digest of its content, so a damaged one is recognised, and the file
that it replaces is kept beside it.
"""

from collections.abc import Iterator
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


def read_archive(path: Path, what: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Plain data and arrays of a file.

    Args:
        path: The file.
        what: What it is, for messages.

    Raises:
        ValueError: If it is not there or damaged; a whole one before it is offered.
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
    return json.loads(str(arrays.pop("meta"))), arrays


def _content(path: Path) -> bytes | None:
    """What a file holds, or None if it is damaged."""
    raw = path.read_bytes()
    start = len(MAGIC) + 32
    whole = raw[:start] == MAGIC + hashlib.sha256(raw[start:]).digest()
    return raw[start:] if whole and len(raw) > start else None
