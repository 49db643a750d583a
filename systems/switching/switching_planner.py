"""The switching planner as a block; its rules are in `switching_rules`."""

from typing import Any

from plants.turtlebot.turtlebot import RobotState
from systems.switching.navigation_planner import (
    PERIOD,
    NavigationPlanner,
    Planned,
    velocity,
)
from systems.switching.signals import Corner, Goal, Mode, PlanarVelocity, Seen
from systems.switching.switching_rules import plan
from systems.switching.switching_state import SwitchingParams, SwitchingState


class SwitchingPlanner(NavigationPlanner):
    """Follows one potential at a time: the goal's, or one obstacle's on one side.

    Sections 2.2 and 3.2 of the thesis, with the involute-helicoid potential in the
    obstacle's frame; see `systems.switching.switching_rules`.

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`; another one starts afresh.
    Port ``corners`` accepts rows of `Corner`; slower where somebody may step out.
    Port ``v_R`` emits the `PlanarVelocity` to take.
    Port ``mode`` emits the `Mode`; its states are `MODES`.
    """

    def __init__(
        self, params: SwitchingParams | None = None, period: float = PERIOD
    ) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__(
            params or SwitchingParams(), period, Goal(0.0, 0.0), SwitchingState()
        )

    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """The velocity to take; remembers the goal and the rules' state."""
        last_goal, state = memory
        if goal != last_goal:
            state = SwitchingState()
        here = (robot.x, robot.y)
        step = plan(self.params, state, here, velocity(robot), goal, seen, corners)
        followed = (step.state.mode, step.state.track, step.state.side)
        mode = Mode(*followed, float(step.retreat), float(step.outrun))
        return Planned(PlanarVelocity(step.v_x, step.v_y), mode, (goal, step.state))
