"""Perception: the obstacles within the disc of vision, with noise.

Section 1.2 of the thesis: an obstacle is seen if its centre is at most R_v away.
How velocities are perceived is left open there; here they are measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from plants.crowd.signals import OBSTACLES, Obstacle
from plants.turtlebot.turtlebot import RobotState
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import rows
from systems.switching.signals import NOISE, SEEN, Noise, Seen

NOTHING = Seen(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class PerceptionParams:
    """Parameters of the perception."""

    vision: float = parameter(3.0, "radius of vision R_v", "m", above=0.0, most=100.0)
    position_noise: float = parameter(
        0.0,
        "standard deviation of a measured position, along each axis",
        "m",
        least=0.0,
        most=0.5,
    )
    velocity_noise: float = parameter(
        0.0, "the same of a measured velocity", "m/s", least=0.0, most=0.15
    )


def perceive(
    params: PerceptionParams,
    robot: RobotState,
    obstacles: Sequence[Obstacle],
    noise: Sequence[Noise],
) -> list[Seen]:
    """What is seen of each obstacle.

    Args:
        params: Parameters.
        robot: The body.
        obstacles: What there is. One that is not known in finite numbers counts as
            in sight, and stops who plans with it.
        noise: Four standard normal numbers for each.
    """
    reach = params.vision * params.vision
    s, w = params.position_noise, params.velocity_noise
    seen = []
    for track, ((x, y, radius, v_x, v_y), e) in enumerate(
        zip(obstacles, noise, strict=True)
    ):
        near = radius > 0.0 and (x - robot.x) ** 2 + (y - robot.y) ** 2 <= reach
        if near or not isfinite(x + y + radius + v_x + v_y):
            place = x + s * e.x, y + s * e.y
            seen.append(
                Seen(float(track), *place, radius, v_x + w * e.v_x, v_y + w * e.v_y)
            )
        else:
            seen.append(NOTHING)
    return seen


class Perception(Block):
    """Sees the obstacles whose centres lie within the disc of radius R_v.

    Section 3.1.1 of the thesis. An obstacle keeps its track identity for ever.

    Port ``robot`` accepts the `RobotState`.
    Port ``obstacles`` accepts rows of `Obstacle`.
    Port ``noise`` accepts rows of `Noise`, one for each obstacle.
    Port ``seen`` emits rows of `Seen`.
    """

    def __init__(self, params: PerceptionParams | None = None) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or PerceptionParams()
        check(self.params)
        self._robot = self.signal_in("robot", RobotState)
        self._obstacles = self.signal_in("obstacles", OBSTACLES)
        self._noise = self.signal_in("noise", NOISE)
        ports = (self._robot, self._obstacles, self._noise)
        self.signal_out(
            "seen", SEEN, self._calc_seen, {port.ticket() for port in ports}
        )

    def _calc_seen(self, context: Any) -> list[float]:
        seen = perceive(
            self.params,
            RobotState(*self._robot.Eval(context).tolist()),
            rows(OBSTACLES, self._obstacles.Eval(context)),
            rows(NOISE, self._noise.Eval(context)),
        )
        return [number for row in seen for number in row]
