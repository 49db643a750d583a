"""Action: from the planner's velocity to a unicycle's speed and turn rate."""

from typing import Any

from plants.turtlebot.signals import Command, RobotState
from systems.common.compiled import compiled
from systems.common.signal import finiteness
from systems.common.step_block import StepBlock
from systems.switching.heading_law import (
    UnicycleControlParams,
    constants,
    heading_law,
)
from systems.switching.signals import Mode, PlanarVelocity

finite_robot = finiteness(RobotState)
finite_velocity = finiteness(PlanarVelocity)
finite_mode = finiteness(Mode)


@compiled
def _control(
    params: Any, robot: RobotState, v: PlanarVelocity, mode: Mode
) -> tuple[Command]:
    if finite_robot(robot) and finite_velocity(v) and finite_mode(mode):
        return (heading_law(params, robot.theta, v.x, v.y, mode.retreat > 0.5),)
    return (Command(0.0, 0.0),)


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
