"""Action: from the planner's velocity to a unicycle's speed and turn rate.

The thesis names the control law without giving it. This one turns the heading
into the velocity's direction, no faster than it can still stop turning, and
drives with the part of the speed that points there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, pi, sqrt
from typing import Any

from systems.common.block import Block
from systems.switching.signals import ROBOT_EXAMPLE

TWO_PI = 2.0 * pi


@dataclass
class UnicycleControlParams:
    """Parameters of the control law."""

    # Turn rate per heading error [1/s].
    gain: float = 4.0
    # Greatest speed [m/s].
    speed: float = 0.5
    # Greatest turn rate [rad/s].
    turn_rate: float = 1.8
    # Greatest turn acceleration [rad/s^2].
    turn_acceleration: float = 3.5
    # Heading error beyond which it drives backwards [rad].
    backwards: float = 1.8

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is not positive and finite.
        """
        for name in ("gain", "speed", "turn_rate", "turn_acceleration"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"{name}={value} must be positive and finite")


def heading_law(
    params: UnicycleControlParams,
    theta: float,
    vx: float,
    vy: float,
    retreat: bool = False,
) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] towards a velocity.

    Args:
        params: Parameters.
        theta: Heading of the body [rad].
        vx: Wanted velocity, x [m/s].
        vy: Wanted velocity, y [m/s].
        retreat: Whether it may drive backwards, to get away without turning.
    """
    size = hypot(vx, vy)
    if size == 0.0:
        return 0.0, 0.0
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
    return speed, turn if error >= 0.0 else -turn


class UnicycleControl(Block):
    """The control law of the robot, section 3.1.2 of the thesis.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``v_R`` accepts the velocity to take in m/s, world frame (2).
    Port ``mode`` accepts the planner's state; its fourth number tells whether the
    body may drive backwards (5).
    Port ``command`` emits speed in m/s and turn rate in rad/s (2).
    """

    def __init__(self, params: UnicycleControlParams | None = None) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or UnicycleControlParams()
        self.params.check()
        self._robot = self.vector_in("robot", ROBOT_EXAMPLE)
        self._v_R = self.vector_in("v_R", [0.4, 0.3])
        self._mode = self.vector_in("mode", [0.0, -1.0, 1.0, 0.0, 0.0])
        ports = (self._robot, self._v_R, self._mode)
        inputs = {port.ticket() for port in ports}
        self.vector_out("command", 2, self._calc_command, inputs)

    def _calc_command(self, context: Any) -> Sequence[float]:
        theta = self._robot.Eval(context).tolist()[2]
        vx, vy = self._v_R.Eval(context).tolist()
        retreat = self._mode.Eval(context).tolist()[3] > 0.5
        return heading_law(self.params, theta, vx, vy, retreat)
