"""Odometry: where the wheels and the gyro say the robot is.

Wheels measure the way too long or too short by a share that stays, and slip from step
to step; the gyro drifts. The robot's start is known, nothing else of its true place.
"""

from dataclasses import dataclass
from math import cos, sin
from typing import Annotated, Any, NamedTuple

from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled, packed
from systems.common.parameter import check, parameter
from systems.common.signal import Field
from systems.common.step_block import StepBlock


class OdometryNoise(NamedTuple):
    """What a step is wrong by, in standard deviations."""

    slip: Annotated[float, Field("1", "of the way", 0.5)]
    turn: Annotated[float, Field("1", "of the turn", -0.5)]
    scale: Annotated[float, Field("1", "of what stays, taken at the first step", 0.5)]
    drift: Annotated[float, Field("1", "of what stays, taken at the first step", 0.5)]


class Odometer(NamedTuple):
    """The block's memory."""

    # Where it believes to be, the true place at the last step, and that there was one.
    x: float
    y: float
    theta: float
    true_x: float
    true_y: float
    true_theta: float
    begun: float
    # What stays wrong: share of the way, and turn rate [rad/s].
    scale: float
    drift: float


@dataclass
class OdometryParams:
    """Errors of a TurtleBot's wheels and gyro, as standard deviations."""

    scale: float = parameter(
        0.01, "of the way, a share that stays", least=0.0, most=0.2
    )
    slip: float = parameter(
        0.02, "of the way, a share that changes every step", least=0.0, most=0.5
    )
    drift: float = parameter(
        5e-4, "of the turn rate, stays", "rad/s", least=0.0, most=0.1
    )
    turn: float = parameter(
        5e-4, "of the heading, every step", "rad", least=0.0, most=0.1
    )
    period: float = parameter(0.05, "of a step", "s", above=0.0, most=1.0)


@compiled
def reckon(
    params: Any, state: Odometer, robot: RobotState, noise: OdometryNoise
) -> tuple[Odometer, RobotState]:
    """One step of dead reckoning: the next memory, and what is believed now."""
    if state.begun == 0.0:
        place = (robot.x, robot.y, robot.theta)
        still = (params.scale * noise.scale, params.drift * noise.drift)
        return Odometer(*place, *place, 1.0, *still), robot
    dx, dy = robot.x - state.true_x, robot.y - state.true_y
    turn = robot.theta - state.true_theta
    middle = state.true_theta + 0.5 * turn
    way = dx * cos(middle) + dy * sin(middle)
    across = dy * cos(middle) - dx * sin(middle)
    if way != 0.0 or turn != 0.0:  # the gyro's zero is taken again where it stands
        way *= 1.0 + state.scale + params.slip * noise.slip
        turn += state.drift * params.period + params.turn * noise.turn
    middle = state.theta + 0.5 * turn
    x = state.x + way * cos(middle) - across * sin(middle)
    y = state.y + way * sin(middle) + across * cos(middle)
    theta = state.theta + turn
    told = RobotState(x, y, theta, robot.v * (1.0 + state.scale), robot.omega)
    true = (robot.x, robot.y, robot.theta)
    return Odometer(x, y, theta, *true, 1.0, state.scale, state.drift), told


class Odometry(StepBlock):
    """Adds up what wheels and gyro tell.

    Port ``robot`` accepts the true `RobotState`.
    Port ``noise`` accepts the `OdometryNoise`.
    Port ``reckoned`` emits the `RobotState` as dead reckoning has it.
    """

    def __init__(self, params: OdometryParams | None = None) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or OdometryParams()
        check(params)
        self.declare_step(
            reckon,
            [packed(params)],
            {"robot": RobotState, "noise": OdometryNoise},
            Odometer(*[0.0] * 9),
            {"reckoned": RobotState},
            params.period,
            timed=False,
            shared=False,
        )
