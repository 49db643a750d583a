"""A TurtleBot as a unicycle with limited speed, turn rate and accelerations.

It is a `SymbolicVectorSystem`: Drake integrates it in C++.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any

from pydrake.symbolic import Variable, cos, max, min, sin
from pydrake.systems.primitives import SymbolicVectorSystem

STATE = ("x", "y", "theta", "v", "omega")
"""Places [m], heading [rad], speed [m/s] and turn rate [rad/s]."""


@dataclass
class TurtlebotParams:
    """A TurtleBot 2 (Kobuki base); accelerations as its drivers' usual limits."""

    # Radius of the body [m].
    radius: float = 0.18
    # Greatest speed, either way [m/s].
    speed: float = 0.5
    # Greatest turn rate [rad/s].
    turn_rate: float = 1.8
    # Greatest acceleration [m/s^2].
    acceleration: float = 1.0
    # Greatest turn acceleration [rad/s^2].
    turn_acceleration: float = 3.5
    # Time constant of the wheels' speed control [s].
    lag: float = 0.05

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is not positive and finite.
        """
        for name, value in vars(self).items():
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"robot: {name}={value} must be positive and finite")


def make_turtlebot(params: TurtlebotParams, start: list[float]) -> Any:
    """Makes the system; its state is `STATE`.

    Its input ``u0`` accepts speed and turn rate to take (2); output ``y0`` emits the
    state (5).

    Args:
        params: Limits.
        start: x, y [m] and heading [rad].

    Raises:
        ValueError: If a parameter is out of range.
    """
    params.check()
    x, y, theta, v, omega = (Variable(name) for name in STATE)
    speed, rate = Variable("speed"), Variable("rate")
    # A context starts at zero: the start stands in the equations.
    heading = theta + start[2]

    def follow(value: Any, wanted: Any, most: float, fastest: float) -> Any:
        """Rate of change towards a wanted value: first order, twice limited."""
        wanted = min(max(wanted, -most), most)
        return min(max((wanted - value) / params.lag, -fastest), fastest)

    return SymbolicVectorSystem(
        state=[x, y, theta, v, omega],
        input=[speed, rate],
        output=[x + start[0], y + start[1], heading, v, omega],
        dynamics=[
            v * cos(heading),
            v * sin(heading),
            omega,
            follow(v, speed, params.speed, params.acceleration),
            follow(omega, rate, params.turn_rate, params.turn_acceleration),
        ],
    )
