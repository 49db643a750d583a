"""Action: from the planner's velocity to a unicycle's speed and turn rate.

The thesis names the control law without giving it. This one turns the heading
into the velocity's direction, no faster than it can still stop turning, and
drives with the part of the speed that points there.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sqrt
from typing import Any

import numpy as np

from plants.turtlebot.turtlebot import Command, RobotState
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import finiteness
from systems.common.step_block import StepBlock
from systems.switching.signals import Mode, PlanarVelocity

TWO_PI = 2.0 * pi
finite_robot = finiteness(RobotState)
finite_velocity = finiteness(PlanarVelocity)
finite_mode = finiteness(Mode)


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


@compiled
def _control(
    params: Any, robot: RobotState, v: PlanarVelocity, mode: Mode
) -> tuple[Command]:
    if finite_robot(robot) and finite_velocity(v) and finite_mode(mode):
        return (heading_law(params, robot.theta, v.x, v.y, mode.retreat > 0.5),)
    return (Command(0.0, 0.0),)


def constants(params: UnicycleControlParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


class UnicycleControl(StepBlock):
    """The control law of the robot, section 3.1.2 of the thesis.

    Where an input is not finite, the robot is to stand.

    Port ``robot`` accepts the `RobotState`.
    Port ``v_R`` accepts the `PlanarVelocity` to take.
    Port ``mode`` accepts the planner's `Mode`: whether to retreat backwards.
    Port ``command`` emits the `Command`.
    """

    def __init__(self, params: UnicycleControlParams | None = None) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.declare_map(
            _control,
            [constants(params or UnicycleControlParams())],
            {"robot": RobotState, "v_R": PlanarVelocity, "mode": Mode},
            "command",
            Command,
        )
