"""The switching planner as a block; its rules are in `switching_rules`."""

from collections.abc import Sequence
from typing import Any

from systems.common.block import Block
from systems.switching.signals import (
    CAPACITY,
    GOAL_EXAMPLE,
    ROBOT_EXAMPLE,
    seen_example,
    tracks,
    velocity,
)
from systems.switching.switching_rules import plan
from systems.switching.switching_state import SwitchingParams, SwitchingState

PERIOD = 0.05
"""Of the planners [s]."""


class SwitchingPlanner(Block):
    """Follows one potential at a time: the goal's, or one obstacle's on one side.

    Sections 2.2 and 3.2 of the thesis, with the involute-helicoid potential in the
    obstacle's frame; see `systems.switching.switching_rules`.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``seen`` accepts the obstacles in sight: track identity, x, y, radius, v_x,
    v_y of each (6 each; identity -1 for none).
    Port ``goal`` accepts the goal x, y in m (2); another goal starts afresh.
    Port ``v_R`` emits the velocity to take in m/s, world frame (2).
    Port ``mode`` emits the state: its number in `MODES`, the obstacle followed (-1
    for none), the sense about it (+1 counter-clockwise), whether the body may
    retreat backwards, and whether an obstacle in sight is as fast as the body (5).
    """

    def __init__(
        self,
        params: SwitchingParams | None = None,
        capacity: int = CAPACITY,
        period: float = PERIOD,
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or SwitchingParams()
        self.params.check()
        self._robot = self.vector_in("robot", ROBOT_EXAMPLE)
        self._seen = self.vector_in("seen", seen_example(capacity))
        self._goal = self.vector_in("goal", GOAL_EXAMPLE)
        state = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *SwitchingState()]
        self._state = self.DeclareDiscreteState(state)
        held = {self.xd_ticket()}
        self.vector_out("v_R", 2, lambda context: self._held(context)[:2], held)
        self.vector_out("mode", 5, self._calc_mode, held)
        self.update_every(period, self._update)

    def _held(self, context: Any) -> list[float]:
        """v_R (2), goal (2), retreat, outrun, then the planner's state."""
        return context.get_discrete_state(self._state).value().tolist()

    def _calc_mode(self, context: Any) -> Sequence[float]:
        held = self._held(context)
        return [*held[6:9], held[4], held[5]]

    def _update(self, context: Any) -> Sequence[float]:
        held = self._held(context)
        robot = self._robot.Eval(context).tolist()
        goal = self._goal.Eval(context).tolist()
        same = goal == held[2:4]
        state = SwitchingState(*held[6:]) if same else SwitchingState()
        step = plan(
            self.params,
            state,
            (robot[0], robot[1]),
            velocity(robot),
            (goal[0], goal[1]),
            tracks(self._seen.Eval(context).tolist()),
        )
        flags = (float(step.retreat), float(step.outrun))
        return [step.v_x, step.v_y, *goal, *flags, *step.state]
