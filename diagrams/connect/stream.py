"""What the robot does, as an OpenIGTLink server tells 3D Slicer and others.

Nobody is waited for: who does not take what is sent misses frames.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import socket
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.common.scenario import ScenarioError
from diagrams.connect.address import MM, Address, resolve
from diagrams.connect.messages import StringMessage, TransformMessage

MOST_CLIENTS = 8


@dataclass
class Client:
    """Somebody who listens, and what of the last frame is not on its way yet."""

    socket: socket.socket
    pending: bytes = b""


class Stream:
    """A server of OpenIGTLink that tells what is where.

    Attributes:
        address: Where it listens.
        port: The port.
        clients: Who listens.
    """

    def __init__(self, address: Address) -> None:
        """Listens.

        Raises:
            ScenarioError: If it cannot listen there.
        """
        self.address = address
        self.clients: list[Client] = []
        family, where = resolve(address, "--stream")
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(where)
            self._socket.listen()
        except OSError as error:
            self._socket.close()
            reason = f"--stream {address.text}: {error.strerror}"
            raise ScenarioError(f"{reason}; expected a free port") from error
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]

    def tell(self, what: Mapping[str, Any], words: str) -> None:
        """Sends where things are, and how the robot is.

        Args:
            what: By name a text; or a point in W in m and where it points, None for
                nowhere.
            words: Why the robot stands, or what it does.
        """
        self._welcome()
        if self.clients:
            found = [
                text(name, told)
                if isinstance(told, str)
                else pose(name, self.address, *told)
                for name, told in what.items()
            ]
            self.send([*found, text("RobotState", words)])

    def send(self, messages: Iterable[Any]) -> None:
        """Sends a frame to all who listen."""
        frame = b"".join(message.pack() for message in messages)
        for client in [*self.clients]:
            try:
                self._serve(client, frame)
            except OSError:
                client.socket.close()
                self.clients.remove(client)

    def close(self) -> None:
        """Ends all connections."""
        for one in (self._socket, *(client.socket for client in self.clients)):
            one.close()
        self.clients.clear()

    def _welcome(self) -> None:
        while len(self.clients) < MOST_CLIENTS:
            try:
                found, _ = self._socket.accept()
            except OSError:
                return
            found.setblocking(False)
            self.clients.append(Client(found))

    def _serve(self, client: Client, frame: bytes) -> None:
        """Sends what can be sent; what the client says is not listened to."""
        try:
            while data := client.socket.recv(1 << 16):
                pass
            if not data:
                raise ConnectionResetError
        except BlockingIOError:
            pass
        client.pending = client.pending or frame
        try:
            sent = client.socket.send(client.pending)
        except BlockingIOError:
            return
        client.pending = client.pending[sent:]


def pose(name: str, address: Address, tip: Any, u: Any = None) -> TransformMessage:
    """A thing with a tip as a TRANSFORM in the other program's frame.

    Args:
        name: Of the device.
        address: Has the frame, and where the tip points in a tool's own.
        tip: p_WP in m, (3).
        u: Where it points, in W, (3); along W's axes if None.
    """
    R_WT = RotationMatrix()
    if u is not None:
        axis = np.array(address.axis, float)
        k = int(np.abs(axis).argmax())
        along = np.asarray(u, float) * axis[k]
        R_WT = RotationMatrix.MakeFromOneVector(along / np.linalg.norm(along), k)
    X_RT = address.X_WR.inverse() @ RigidTransform(R_WT, tip)
    matrix = X_RT.GetAsMatrix4()
    matrix[:3, 3] /= MM
    return TransformMessage(matrix, device_name=name)


def text(name: str, words: str) -> StringMessage:
    """A STRING."""
    return StringMessage(words, device_name=name)
