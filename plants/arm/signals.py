"""The signals of the arm's seven joints."""

from typing import Annotated, NamedTuple

from plants.arm.parameters import JOINTS, READY_POSTURE
from systems.common.signal import Field

type Seven = tuple[float, float, float, float, float, float, float]

_NUMBERS = range(1, JOINTS + 1)
_POSITIONS = tuple(f"q{i}" for i in _NUMBERS)
_VELOCITIES = tuple(f"v{i}" for i in _NUMBERS)


class Posture(NamedTuple):
    """Positions of the joints."""

    q: Annotated[Seven, Field("rad", "positions", READY_POSTURE, _POSITIONS)]


class ArmState(NamedTuple):
    """Positions and velocities of the joints: measured, or sent to the servos."""

    q: Annotated[Seven, Field("rad", "positions", READY_POSTURE, _POSITIONS)]
    v: Annotated[Seven, Field("rad/s", "velocities", (0.0,) * JOINTS, _VELOCITIES)]
