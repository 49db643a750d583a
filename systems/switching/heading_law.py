"""The law by which a unicycle follows a velocity.

The thesis names the control law without giving it. This one turns the heading
into the velocity's direction, no faster than it can still stop turning, and
drives with the part of the speed that points there.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sqrt
from typing import Any

import numpy as np

from plants.turtlebot.signals import Command
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter

TWO_PI = 2.0 * pi


@dataclass
class UnicycleControlParams:
    """Parameters of the control law."""

    gain: float = parameter(
        4.0, "turn rate per heading error", "1/s", above=0.0, most=20.0
    )
    speed: float = parameter(0.5, "greatest", "m/s", above=0.0, most=3.0)
    turn_rate: float = parameter(1.8, "greatest", "rad/s", above=0.0, most=10.0)
    turn_acceleration: float = parameter(
        3.5, "greatest", "rad/s^2", above=0.0, most=50.0
    )
    backwards: float = parameter(
        1.8,
        "heading error beyond which it may drive backwards",
        "rad",
        least=0.5 * pi,
        most=pi,
    )


def constants(params: UnicycleControlParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


@compiled
def heading_law(
    params: Any, theta: float, vx: float, vy: float, retreat: bool
) -> Command:
    """Speed and turn rate towards a velocity.

    Args:
        params: A record of `constants`.
        theta: Heading of the body [rad].
        vx: Wanted velocity, x [m/s].
        vy: Wanted velocity, y [m/s].
        retreat: Whether it may drive backwards, to get away without turning.
    """
    size = hypot(vx, vy)
    if size == 0.0:
        return Command(0.0, 0.0)
    error = (atan2(vy, vx) - theta + pi) % TWO_PI - pi
    backwards = retreat and abs(error) > params.backwards
    if backwards:
        error += pi if error < 0.0 else -pi
    turn = min(
        params.gain * abs(error),
        sqrt(2.0 * params.turn_acceleration * abs(error)),
        params.turn_rate,
    )
    speed = min(size, params.speed) * max(0.0, cos(error))
    if backwards:
        speed = -speed
    return Command(speed, turn if error >= 0.0 else -turn)
