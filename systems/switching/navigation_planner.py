"""The base of the mobile robot's planners: their ports, and what they hold."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

from systems.common.block import Block
from systems.switching.arcs import Obstacle
from systems.switching.signals import (
    GOAL_EXAMPLE,
    ROBOT_EXAMPLE,
    seen_example,
    tracks,
)

PERIOD = 0.05
"""Of all planners, in s."""


class NavigationPlanner(Block):
    """A planner that takes a velocity every period and holds it in between.

    Its state begins with that velocity.
    """

    def declare(
        self,
        state: Sequence[float],
        mode: Callable[[list[float]], Sequence[float]],
        capacity: int,
        period: float,
    ) -> None:
        """Declares ports, state and update.

        Args:
            state: What is held at first: the velocity (2), and the planner's own.
            mode: Port ``mode``'s value (5) from what is held.
            capacity: Obstacles in sight at most.
            period: In s.
        """
        self._robot = self.vector_in("robot", ROBOT_EXAMPLE)
        self._seen = self.vector_in("seen", seen_example(capacity))
        self._goal = self.vector_in("goal", GOAL_EXAMPLE)
        self._state = self.DeclareDiscreteState([*state])
        ticket = {self.xd_ticket()}
        self.vector_out("v_R", 2, lambda context: self._held(context)[:2], ticket)
        self.vector_out("mode", 5, lambda context: mode(self._held(context)), ticket)
        self.update_every(period, self._update)

    def _held(self, context: Any) -> list[float]:
        return context.get_discrete_state(self._state).value().tolist()

    def _update(self, context: Any) -> Sequence[float]:
        return self.plan(
            self._held(context),
            self._robot.Eval(context).tolist(),
            self._goal.Eval(context).tolist(),
            tracks(self._seen.Eval(context).tolist()),
        )

    @abstractmethod
    def plan(
        self,
        held: list[float],
        robot: list[float],
        goal: list[float],
        seen: list[Obstacle],
    ) -> Sequence[float]:
        """What is held from now on.

        Args:
            held: What is held so far.
            robot: The body's x, y in m, heading in rad, speed, turn rate (5).
            goal: Its x, y in m (2).
            seen: The obstacles in sight.
        """
