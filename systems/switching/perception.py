"""Perception: the obstacles within the disc of vision, with noise.

Section 1.2 of the thesis: an obstacle is seen if its centre is at most R_v away.
How velocities are perceived is left open there; here they are measured.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.crowd.signals import OBSTACLES, Obstacle
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import finiteness, reader, size
from systems.common.step_block import StepBlock
from systems.switching.signals import NOISE, SEEN, STANDING, Noise, Seen

SEEN_SIZE = size(Seen)
read_obstacle = reader(Obstacle)
read_noise = reader(Noise)
finite_obstacle = finiteness(Obstacle)


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


@compiled
def perceive(
    params: Any, robot: RobotState, obstacles: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray]:
    """What is seen of each obstacle.

    Args:
        params: A record of `PerceptionParams`.
        robot: The body.
        obstacles: Rows of `Obstacle`. One that is not known in finite numbers counts
            as in sight, and stops who plans with it.
        noise: Rows of `Noise`, one for each: four standard normal numbers.

    Returns:
        Rows of `Seen`; those of points that stand are empty.
    """
    seen = np.zeros((len(obstacles) + STANDING, SEEN_SIZE))
    seen[:, 0] = -1.0
    reach = params.vision * params.vision
    s, w = params.position_noise, params.velocity_noise
    for track in range(len(obstacles)):
        o, e = read_obstacle(obstacles[track]), read_noise(noise[track])
        row = Seen(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        near = o.radius > 0.0 and (o.x - robot.x) ** 2 + (o.y - robot.y) ** 2 <= reach
        if near or not finite_obstacle(o):
            x, y = o.x + s * e.x, o.y + s * e.y
            v_x, v_y = o.v_x + w * e.v_x, o.v_y + w * e.v_y
            row = Seen(float(track), x, y, o.radius, v_x, v_y)
        seen[track, :] = row
    return (seen,)


class Perception(StepBlock):
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
        params = params or PerceptionParams()
        check(params)
        self.declare_map(
            perceive,
            [packed(params)],
            {"robot": RobotState, "obstacles": OBSTACLES, "noise": NOISE},
            "seen",
            SEEN,
        )
