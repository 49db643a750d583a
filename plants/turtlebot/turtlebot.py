"""A TurtleBot as a unicycle with limited speed, turn rate and accelerations.

It is a `SymbolicVectorSystem`: Drake integrates it in C++.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from pydrake.symbolic import Variable, cos, max, min, sin
from pydrake.systems.primitives import SymbolicVectorSystem

from plants.turtlebot.signals import Command, RobotState
from systems.common.parameter import check, parameter

BODIES: dict[str, dict[str, float]] = {
    "turtlebot2": {},
    "turtlebot3_burger": {
        "radius": 0.113,
        "speed": 0.22,
        "turn_rate": 2.84,
        "acceleration": 2.5,
        "turn_acceleration": 3.2,
    },
    "turtlebot3_waffle": {
        "radius": 0.208,
        "speed": 0.26,
        "turn_rate": 1.82,
        "acceleration": 2.5,
        "turn_acceleration": 3.2,
    },
    "turtlebot4": {
        "radius": 0.171,
        "speed": 0.46,
        "turn_rate": 1.9,
        "acceleration": 0.9,
        "turn_acceleration": 7.7,
    },
}
"""Sizes (a circle about the base) and speeds of their data sheets; accelerations of
their drivers' limits, a TurtleBot 4's turning by its wheels' at 0.233 m of track."""


@dataclass
class TurtlebotParams:
    """A TurtleBot 2 (Kobuki base); accelerations as its drivers' usual limits."""

    model: str = parameter(
        "turtlebot2",
        "whose numbers are taken for those left at a TurtleBot 2's",
        choices=tuple(BODIES),
    )
    radius: float = parameter(0.18, "of the body", "m", least=0.05, most=1.0)
    speed: float = parameter(0.5, "greatest, either way", "m/s", above=0.0, most=3.0)
    turn_rate: float = parameter(1.8, "greatest", "rad/s", above=0.0, most=10.0)
    acceleration: float = parameter(1.0, "greatest", "m/s^2", above=0.0, most=10.0)
    turn_acceleration: float = parameter(
        3.5, "greatest", "rad/s^2", above=0.0, most=50.0
    )
    # Below its bound the integrator's step of 0.05 s would be unstable.
    lag: float = parameter(
        0.05, "time constant of the wheels' speed control", "s", least=0.02, most=1.0
    )

    def __post_init__(self) -> None:
        """Numbers that nobody gave are the model's."""
        defaults = {f.name: f.default for f in fields(self)}
        for name, value in BODIES.get(self.model, {}).items():
            if getattr(self, name) == defaults[name]:
                setattr(self, name, value)


def make_turtlebot(params: TurtlebotParams, start: Sequence[float]) -> Any:
    """Makes the system; its state is a `RobotState`.

    Its input ``u0`` accepts a `Command`; output ``y0`` emits the `RobotState`.

    Args:
        params: Limits.
        start: x, y [m] and heading [rad].

    Raises:
        ParameterError: If a parameter is out of range.
    """
    check(params, "robot")
    start_x, start_y, start_theta = start
    x, y, theta, v, omega = (Variable(name) for name in RobotState._fields)
    speed, rate = (Variable(name) for name in Command._fields)
    # A context starts at zero: the start stands in the equations.
    heading = theta + start_theta

    def follow(value: Any, wanted: Any, most: float, fastest: float) -> Any:
        """Rate of change towards a wanted value: first order, twice limited."""
        wanted = min(max(wanted, -most), most)
        return min(max((wanted - value) / params.lag, -fastest), fastest)

    return SymbolicVectorSystem(
        state=[x, y, theta, v, omega],
        input=[speed, rate],
        output=[x + start_x, y + start_y, heading, v, omega],
        dynamics=[
            v * cos(heading),
            v * sin(heading),
            omega,
            follow(v, speed, params.speed, params.acceleration),
            follow(omega, rate, params.turn_rate, params.turn_acceleration),
        ],
    )
