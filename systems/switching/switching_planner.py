"""The switching planner as a block; its rules are in `switching_rules`."""

from math import isfinite
from typing import Any

import numpy as np

from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled
from systems.common.signal import finiteness
from systems.common.step_block import StepBlock
from systems.switching.evasion import Body
from systems.switching.heading_law import UnicycleControlParams
from systems.switching.heading_law import constants as law_constants
from systems.switching.navigation_planner import NO_CORNERS, PERIOD, velocity
from systems.switching.signals import CORNERS, SEEN, Goal, Mode, PlanarVelocity
from systems.switching.switching_rules import planned
from systems.switching.switching_state import (
    EVADE,
    START,
    SwitchingParams,
    SwitchingState,
    constants,
)

finite_robot, finite_goal = finiteness(RobotState), finiteness(Goal)


@compiled
def _update(
    params: Any,
    law: Any,
    held: PlanarVelocity,
    mode: Mode,
    last_goal: Goal,
    state: SwitchingState,
    robot: RobotState,
    seen: np.ndarray,
    goal: Goal,
    corners: np.ndarray,
) -> tuple[PlanarVelocity, Mode, Goal, SwitchingState]:
    """Velocity, mode, goal and state from now on."""
    known = finite_robot(robot) and finite_goal(goal)
    if not known or not isfinite(seen.sum() + corners.sum()):
        return PlanarVelocity(0.0, 0.0), mode, last_goal, state
    if goal.x != last_goal.x or goal.y != last_goal.y:
        state = START
    place, to = (robot.x, robot.y), (goal.x, goal.y)
    body = Body(robot.theta, robot.v, robot.omega)
    v = velocity(robot)
    step = planned(params, law, state, place, v, to, seen, corners, body)
    new = step.state
    retreat, outrun = 1.0 if step.retreat else 0.0, 1.0 if step.outrun else 0.0
    evades = new.flee_x != 0.0 or new.flee_y != 0.0
    state_now = float(EVADE) if evades else new.mode
    mode = Mode(state_now, new.track, new.side, retreat, outrun)
    return PlanarVelocity(step.v_x, step.v_y), mode, goal, new


class SwitchingPlanner(StepBlock):
    """Follows one potential at a time: the goal's, or one obstacle's on one side.

    Sections 2.2 and 3.2 of the thesis, with the involute-helicoid potential in the
    obstacle's frame; see `systems.switching.switching_rules`.

    Where an input is not finite, the robot is to stand.

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`; another one starts afresh.
    Port ``corners`` accepts rows of `Corner`; slower where somebody may step out.
    Port ``v_R`` emits the `PlanarVelocity` to take.
    Port ``mode`` emits the `Mode`; its states are `MODES`.
    """

    def __init__(
        self,
        params: SwitchingParams | None = None,
        period: float = PERIOD,
        control: UnicycleControlParams | None = None,
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            period: In s.
            control: Of the wheels' control, as far as evasions reckon with it.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.declare_update(
            _update,
            [
                constants(params or SwitchingParams()),
                law_constants(control or UnicycleControlParams()),
            ],
            {"robot": RobotState, "seen": SEEN, "goal": Goal, "corners": CORNERS},
            {
                "v_R": PlanarVelocity(0.0, 0.0),
                "mode": Mode(),
                "_goal": Goal(0.0, 0.0),
                "_state": START,
            },
            period,
            timed=False,
            defaults={"corners": NO_CORNERS},
        )
