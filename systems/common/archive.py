"""Files that outlive a program killed in the middle of writing them.

Each carries a digest of its content, so a damaged one is recognised, and the file
that it replaces is kept beside it.
"""

import hashlib
import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

MAGIC = b"trocar-archive-1"


def before(path: Path) -> Path:
    """Where the file before this one is kept."""
    return path.with_name(path.name + ".before")


def beside(path: Path, what: str) -> Path:
    """Where what belongs to a file is kept, by its name."""
    return path.with_name(f"{path.name}.{what}")


def write_archive(path: Path, meta: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Writes plain data and arrays; the file before is kept as `*.before`.

    At no instant is there no whole file.
    """
    buffer = io.BytesIO()
    np.savez_compressed(buffer, meta=np.array(json.dumps(meta)), **arrays)
    content = buffer.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = beside(path, "draft")
    with draft.open("wb") as stream:
        stream.write(MAGIC + hashlib.sha256(content).digest() + content)
        stream.flush()
        os.fsync(stream.fileno())
    if path.exists():
        os.replace(path, before(path))
    os.replace(draft, path)


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
