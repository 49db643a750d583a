"""Perception: the obstacles within the disc of vision, with noise.

Section 1.2 of the thesis: an obstacle is seen if its centre is at most R_v away.
How velocities are perceived is left open there; here they are measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from systems.common.block import Block
from systems.switching.signals import CAPACITY, ROBOT_EXAMPLE, obstacles_example


@dataclass
class PerceptionParams:
    """Parameters of the perception."""

    # Radius of vision R_v [m].
    vision: float = 3.0
    # Standard deviation of a measured position, along each axis [m].
    position_noise: float = 0.0
    # The same of a measured velocity [m/s].
    velocity_noise: float = 0.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is out of range; tells the range.
        """
        if not (self.vision > 0.0 and isfinite(self.vision)):
            raise ValueError(f"perception: vision={self.vision} m must be > 0")
        for name in ("position_noise", "velocity_noise"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(
                    f"perception: {name}={getattr(self, name)} must lie in [0, 1]"
                )


def perceive(
    params: PerceptionParams,
    place: Sequence[float],
    obstacles: Sequence[float],
    noise: Sequence[float],
) -> list[float]:
    """The rows of `seen` (6 each) for the rows of `obstacles` (5 each).

    Args:
        params: Parameters.
        place: The robot's x, y [m].
        obstacles: x, y, radius, v_x, v_y of each; a radius of zero is nothing.
        noise: Four standard normal numbers for each.

    Raises:
        ValueError: If a number is not finite; tells which obstacle's.
    """
    px, py = place[0], place[1]
    reach = params.vision * params.vision
    s, w = params.position_noise, params.velocity_noise
    seen: list[float] = []
    for track in range(len(obstacles) // 5):
        x, y, radius, vx, vy = obstacles[5 * track : 5 * track + 5]
        if not isfinite(x + y + radius + vx + vy):
            raise ValueError(
                f"obstacle {track}: {[x, y, radius, vx, vy]} must be finite numbers"
            )
        if radius > 0.0 and (x - px) ** 2 + (y - py) ** 2 <= reach:
            a, b, c, d = noise[4 * track : 4 * track + 4]
            seen += [float(track), x + s * a, y + s * b, radius, vx + w * c, vy + w * d]
        else:
            seen += [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    return seen


class Perception(Block):
    """Sees the obstacles whose centres lie within the disc of radius R_v.

    Section 3.1.1 of the thesis. An obstacle keeps its track identity for ever.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``obstacles`` accepts x, y, radius, v_x, v_y of each obstacle (5 each).
    Port ``noise`` accepts four standard normal numbers for each obstacle.
    Port ``seen`` emits the obstacles in sight: track identity, x, y, radius, v_x,
    v_y of each (6 each; identity -1 for none).
    """

    def __init__(
        self, params: PerceptionParams | None = None, capacity: int = CAPACITY
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or PerceptionParams()
        self.params.check()
        self._robot = self.vector_in("robot", ROBOT_EXAMPLE)
        self._obstacles = self.vector_in("obstacles", obstacles_example(capacity))
        self._noise = self.vector_in("noise", [0.0] * (4 * capacity))
        ports = (self._robot, self._obstacles, self._noise)
        self.vector_out(
            "seen", 6 * capacity, self._calc_seen, {port.ticket() for port in ports}
        )

    def _calc_seen(self, context: Any) -> Sequence[float]:
        return perceive(
            self.params,
            self._robot.Eval(context).tolist(),
            self._obstacles.Eval(context).tolist(),
            self._noise.Eval(context).tolist(),
        )
