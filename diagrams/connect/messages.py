"""Messages of OpenIGTLink: packed and unpacked by `pyigtl`, checked here.

pyigtl 0.3 knows no STATUS, lays out POSITION as if it were POINT, takes what comes
without looking at its checksum, and never finds out that the other side has gone: so
sockets are our own (`tracker.py`, `stream.py`), and these two messages as well.
"""

import struct
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pyigtl.messages import CRC64, MessageBase, StringMessage, TransformMessage

HEADER = MessageBase.IGTL_HEADER_SIZE
LARGEST = 1 << 28
"""Of a body that is believed, in bytes: an image may come by."""
LARGEST_KEPT = 1 << 16
"""Of one that is looked into; a size that was damaged must not make us deaf."""
OK = 1
"""Code of a STATUS that says that all is well."""
_STATUS = struct.Struct(">Hq20s")


class StatusMessage(MessageBase):
    """How a device is."""

    def __init__(self, code: int = OK, text: str = "", **named: Any) -> None:
        super().__init__(**named)
        self._message_type, self._valid_message = "STATUS", True
        self.code, self.text = code, text

    def _pack_content(self) -> bytes:
        return _STATUS.pack(self.code, 0, b"") + self.text.encode() + b"\0"

    def _unpack_content(self, content: bytes) -> None:
        self.code, _, _ = _STATUS.unpack_from(content)
        self.text = content[_STATUS.size :].rstrip(b"\0").decode("utf-8", "replace")


class PositionMessage(MessageBase):
    """A pose by place and quaternion x, y, z, w; the latter may be left out."""

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        self._message_type, self._valid_message = "POSITION", True
        self.matrix = np.eye(4)

    def _pack_content(self) -> bytes:
        turn = RotationMatrix(self.matrix[:3, :3]).ToQuaternion()
        q = (turn.x(), turn.y(), turn.z(), turn.w())
        return struct.pack(">7f", *self.matrix[:3, 3], *q)

    def _unpack_content(self, content: bytes) -> None:
        # Three numbers of a quaternion leave out w, which then is not negative.
        numbers = np.array(struct.unpack(f">{len(content) // 4}f", content), float)
        if len(numbers) not in (3, 6, 7):
            raise ValueError(f"a POSITION of {len(content)} bytes")
        q = np.append(numbers[3:], [0.0, 0.0, 0.0, 1.0][len(numbers) - 3 :])
        if len(numbers) == 6:
            q[3] = np.sqrt(max(0.0, 1.0 - q[:3] @ q[:3]))
        q /= np.linalg.norm(q)
        turn = RotationMatrix(Quaternion(wxyz=[q[3], *q[:3]]))
        self.matrix = np.eye(4)
        self.matrix[:3, :3], self.matrix[:3, 3] = turn.matrix(), numbers[:3]


KINDS = {
    "TRANSFORM": TransformMessage,
    "POSITION": PositionMessage,
    "STATUS": StatusMessage,
    "STRING": StringMessage,
}
"""What is looked into; all else is passed over."""


class Garbage(ValueError):
    """What came is no OpenIGTLink: nobody knows where the next message begins."""


class Unpacker:
    """Makes messages of bytes as they come, however they are cut.

    Attributes:
        refused: Messages that were damaged.
    """

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._passed_over = 0
        self.refused = 0

    def feed(self, data: bytes) -> list[Any]:
        """Messages that are whole now.

        Raises:
            Garbage: If what came is no header of one.
        """
        self._bytes += data
        found: list[Any] = []
        while True:
            if self._passed_over:
                skipped = min(self._passed_over, len(self._bytes))
                del self._bytes[:skipped]
                self._passed_over -= skipped
            if self._passed_over or len(self._bytes) < HEADER:
                return found
            fields = _header(bytes(self._bytes[:HEADER]))
            size, kind = fields["body_size"], fields["message_type"]
            if kind in KINDS and size > LARGEST_KEPT:
                raise Garbage(f"a {kind} of {size} bytes")
            if kind not in KINDS:
                self._passed_over = HEADER + size
                continue
            if len(self._bytes) < HEADER + size:
                return found
            body = bytes(self._bytes[HEADER : HEADER + size])
            (crc,) = struct.unpack_from(">Q", self._bytes, HEADER - 8)
            del self._bytes[: HEADER + size]
            message = _message(kind, fields, body) if CRC64(body) == crc else None
            if message is None:
                self.refused += 1
            else:
                found.append(message)


def _header(data: bytes) -> dict[str, Any]:
    """The fields of a header."""
    try:
        fields: dict[str, Any] = MessageBase.parse_header(data)
    except (UnicodeDecodeError, struct.error) as error:
        raise Garbage("a header whose names are none") from error
    named = fields["message_type"].isprintable() and fields["message_type"]
    if not named or fields["header_version"] not in (1, 2, 3):
        raise Garbage("a header of no known version")
    if fields["body_size"] > LARGEST:
        raise Garbage(f"a body of {fields['body_size']} bytes")
    return fields


def _message(kind: str, fields: dict[str, Any], body: bytes) -> Any:
    """The message of a body; None if it makes no sense."""
    message = KINDS[kind]()
    try:
        message.unpack(fields, body)
    except Exception:  # pyigtl raises what struct, decode and itself do, TypeError too
        return None
    return message
