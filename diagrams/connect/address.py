"""Addresses of OpenIGTLink: where the other program is, and in what frame it speaks.

`igtl://HOST:PORT?target=StylusTipToReference&frame=0,0,120,0,0,90&patience=0.2`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
import socket
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from diagrams.common.scenario import ScenarioError, nearest

PORT = 18944
"""Of OpenIGTLink, if none is given."""
AXES = {
    sign + name: [float(sign + "1") * (name == axis) for axis in "xyz"]
    for sign in ("", "-")
    for name in "xyz"
}
"""Where a tool's tip points, in its own frame."""
MM = 1e-3
"""The protocol's unit [m]."""


@dataclass(frozen=True)
class Address:
    """An address, and what is agreed upon.

    Attributes:
        host: Name or number of a machine.
        port: Of TCP.
        devices: By tool, the name that the other program has for it, if it is said.
        X_WR: Pose of its reference frame R in W.
        axis: Where a tool's tip points in the tool's own frame, (3). SlicerIGT and PLUS
            calibrate shafts to lie along -z of it, behind the tip.
        patience: How long what was said last holds [s].
    """

    host: str
    port: int
    devices: Mapping[str, str] = field(default_factory=dict)
    X_WR: Any = field(default_factory=RigidTransform)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    patience: float = 0.2

    @property
    def text(self) -> str:
        """Host and port, for people."""
        return f"igtl://{self.host}:{self.port}"


def parse(text: str, option: str, tools: Sequence[str] = ()) -> Address:
    """Reads an address.

    Args:
        text: As the module says; a host that is left out is this machine.
        option: Of the command line that it is for, for the message.
        tools: That may be called something else.

    Raises:
        ScenarioError: If it is none, or names what is not there.
    """

    def refuse(expected: str) -> ScenarioError:
        return ScenarioError(f"{option} {text!r}: expected {expected}")

    try:
        parts = urlsplit(text)
        host, port = parts.hostname or "localhost", parts.port
    except ValueError as error:
        raise refuse("igtl://HOST:PORT, a port <= 65535") from error
    if parts.scheme != "igtl" or not parts.netloc or parts.path.strip("/"):
        raise refuse(f"igtl://HOST:PORT, e.g. igtl://localhost:{PORT}")
    told: dict[str, Any] = {}
    devices: dict[str, str] = {}
    for key, value in parse_qsl(parts.query, keep_blank_values=True):
        if key in tools and value:
            devices[key] = value
        elif key == "frame":
            told["X_WR"] = _pose(_numbers(value, 6, key, refuse))
        elif key == "axis" and value in AXES:
            told[key] = AXES[value]
        elif key == "axis":
            raise refuse(f"axis one of {', '.join(AXES)}")
        elif key == "patience":
            (told[key],) = _numbers(value, 1, key, refuse)
            if not told[key] > 0.0:
                raise refuse("patience > 0 s, or inf")
        else:
            known = [*tools, "frame", "axis", "patience"]
            raise refuse(f"another key than {key!r}: {nearest(key, known)}")
    return Address(host, PORT if port is None else port, devices, **told)


def _numbers(text: str, count: int, key: str, refuse: Any) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    is_told = not any(map(math.isnan, numbers))
    far = count > 1 and max(map(abs, numbers), default=0.0) >= 1e5
    if len(numbers) != count or far or not is_told:
        meaning = "X,Y,Z in mm,ROLL,PITCH,YAW in degrees" if count > 1 else "seconds"
        raise refuse(f"{key}={meaning}")
    return numbers


def _pose(numbers: Sequence[float]) -> Any:
    """A pose of x, y, z in mm and roll, pitch, yaw in degrees."""
    turn = RollPitchYaw(np.deg2rad(numbers[3:]))
    return RigidTransform(turn, MM * np.array(numbers[:3]))


def resolve(address: Address, option: str) -> Any:
    """Family and address of a socket.

    Raises:
        ScenarioError: If there is no such host.
    """
    try:
        found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "no name of a machine"
        raise ScenarioError(f"{option} {address.text}: {reason}") from error
    return found[0][0], found[0][4]
