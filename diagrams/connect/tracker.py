"""A tracker of another program, PLUS or 3D Slicer, as the surgeon's tools here.

It is asked between two frames of the simulation and never waited for: the socket is
polled, there is no thread.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import errno
import os
import select
import socket
from time import monotonic, sleep
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.common.scenario import ScenarioError
from diagrams.connect.address import MM, Address, resolve
from diagrams.connect.messages import OK, Garbage, Unpacker
from plants.surgeon.tracked_tool import Sighting
from systems.common.signal import vector

RETRY = 0.5
"""Between two attempts to connect [s]."""
FIRST = 5.0
"""How long the first attempts may take [s]."""
FARTHEST = 2.0
"""Of a tool from W's origin; what is farther was not seen there [m]."""
_SKEW = 0.01
"""How far a rotation's columns may be from being orthonormal."""
_CHUNK = 1 << 16
_MOST = 1 << 24  # bytes taken at one look


@dataclass
class Heard:
    """What was heard of a device last: its matrix in mm, whether it is good, when."""

    matrix: np.ndarray
    good: bool
    at: float


class Tracker:
    """A client of an OpenIGTLink server that tells where tools are.

    Attributes:
        address: Where it is.
        state: In words: connected, or why not.
        refused: Damaged messages, and connections that were given up for garbage.
        tools: Which tools it sees: those that the address names, or all.
    """

    def __init__(self, address: Address, tools: Sequence[str]) -> None:
        """Begins to connect; `poll` goes on with it.

        Args:
            address: Where it is, and how it calls what.
            tools: Names of the tools.

        Raises:
            ScenarioError: If there is no such host.
        """
        self.address = address
        self.state, self.refused = "not connected yet", 0
        self._where = resolve(address, "--tracker")
        self.tools = tuple(address.devices) or tuple(tools)
        self._socket: socket.socket | None = None
        self._is_connected, self._next = False, 0.0
        self._unpacker = Unpacker()
        self._heard: dict[str, Heard] = {}
        self._status: dict[str, tuple[int, str]] = {}

    @property
    def is_connected(self) -> bool:
        """Whether the other side is there."""
        return self._is_connected

    @property
    def devices(self) -> list[str]:
        """Names of all that was heard of."""
        return sorted(self._heard)

    def wait(self, longest: float = FIRST) -> None:
        """Waits for the first connection.

        Raises:
            ScenarioError: If it does not come about.
        """
        end = monotonic() + longest
        while not self._is_connected:
            self.poll()
            if monotonic() > end:
                raise ScenarioError(
                    f"--tracker {self.address.text}: {self.state}; expected a server "
                    "of OpenIGTLink there, e.g. PlusServer, or 3D Slicer's "
                    "OpenIGTLinkIF as a server"
                )
            sleep(0.01)

    def poll(self) -> None:
        """Takes what has come; connects again where that was lost."""
        try:
            if self._socket is None:
                self._begin()
            if not self._is_connected and not self._arrived():
                return
            for message in self._received():
                self._take(message)
        except Garbage as error:
            self.refused += 1
            self._lose(f"{error} is no OpenIGTLink, connection given up")
        except OSError as error:
            self._lose(error.strerror or str(error))

    def close(self) -> None:
        """Ends the connection."""
        self._lose("closed")

    def _begin(self) -> None:
        if monotonic() < self._next:
            return
        self._next = monotonic() + RETRY
        family, where = self._where
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        code = self._socket.connect_ex(where)
        if code not in (0, errno.EINPROGRESS):
            raise OSError(code, os.strerror(code))

    def _arrived(self) -> bool:
        """Whether the connection has come about."""
        if self._socket is None:
            return False
        _, writable, _ = select.select([], [self._socket], [], 0.0)
        if not writable:
            return False
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, os.strerror(code))
        self._is_connected, self.state = True, "connected"
        self._unpacker = Unpacker()
        return True

    def _received(self) -> list[Any]:
        assert self._socket is not None
        messages, taken, damaged = [], 0, self._unpacker.refused
        while taken < _MOST:
            try:
                data = self._socket.recv(_CHUNK)
            except BlockingIOError:
                break
            if not data:
                raise OSError(errno.ECONNRESET, "connection closed by the other side")
            taken += len(data)
            messages += self._unpacker.feed(data)
        self.refused += self._unpacker.refused - damaged
        return messages

    def _lose(self, why: str) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket, self._is_connected, self.state = None, False, why
        self._next = max(self._next, monotonic() + 0.1)
        self._heard, self._status = {}, {}

    def _take(self, message: Any) -> None:
        name = message.device_name
        if message.message_type == "STATUS":
            self._status[name] = (message.code, message.text)
        elif message.message_type in ("TRANSFORM", "POSITION"):
            told = {key.lower(): value for key, value in message.metadata.items()}
            status = told.get("transformstatus", told.get("status", "OK"))
            good = status.upper() == "OK"
            self._heard[name] = Heard(np.array(message.matrix), good, monotonic())

    def device_of(self, tool: str) -> str:
        """What the other program calls a tool: `Tool` or, as PLUS does, `ToolTo...`."""
        if tool in self.address.devices:
            return self.address.devices[tool]
        for device in self.devices:
            low = device.lower()
            if low == tool.lower() or low.startswith(f"{tool.lower()}to"):
                return device
        return tool

    def sighting(self, tool: str, last: Sighting) -> Sighting:
        """Where a tool is now.

        Args:
            tool: Its name here.
            last: Its sighting before, which holds its place while it is out of sight.
        """
        device = self.device_of(tool)
        heard = self._heard.get(device)
        mine = [self.device_of(other) for other in self.tools if other != tool]
        ill = [name for name, (code, _) in self._status.items() if code != OK]
        fits = heard is not None and heard.good
        fits = fits and monotonic() - heard.at <= self.address.patience  # type: ignore
        if not fits or any(name not in mine for name in ill):
            return last._replace(seen=0.0)
        assert heard is not None
        shaft = shaft_of(heard.matrix, self.address)
        return last._replace(seen=0.0) if shaft is None else Sighting(*shaft, 1.0)

    def told(self) -> str:
        """How it is, for people: its state, and what it has not heard of."""
        ill = [f"{n}: {t or c}" for n, (c, t) in self._status.items() if c != OK]
        silent = [t for t in self.tools if self.device_of(t) not in self._heard]
        if self._is_connected and silent and not ill:
            known = ", ".join(self.devices) or "none"
            ill = [f"nothing of {', '.join(silent)} (devices: {known})"]
        return "; ".join([self.state, *ill])


def shaft_of(matrix: np.ndarray, address: Address) -> tuple[Any, Any] | None:
    """Tip in m and direction in W of a tool's pose; None if it is no place of a tool.

    Args:
        matrix: X_RT of the tool's frame T, its origin at the tip, (4, 4) in mm.
        address: Has X_WR and T's axis.
    """
    R, p = matrix[:3, :3], MM * matrix[:3, 3]
    if not np.isfinite(matrix).all() or np.abs(R.T @ R - np.eye(3)).max() > _SKEW:
        return None
    if np.linalg.det(R) < 0.0:
        return None
    X_RT = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p)
    X_WT = address.X_WR @ X_RT
    if np.linalg.norm(X_WT.translation()) > FARTHEST:
        return None
    u = X_WT.rotation() @ np.array(address.axis, float)
    return vector(X_WT.translation()), vector(u)
