"""The base of the mobile robot's planners: their ports, and what they hold."""

from abc import abstractmethod
from collections.abc import Sequence
from math import cos, isfinite, sin
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.turtlebot import RobotState
from systems.common.block import Block
from systems.common.signal import rows
from systems.switching.signals import SEEN, Goal, Mode, PlanarVelocity, Seen

PERIOD = 0.05
"""Of all planners, in s."""


class Planned(NamedTuple):
    """What is held until the next step: velocity, mode, and the planner's memory."""

    v_R: PlanarVelocity
    mode: Mode
    memory: Sequence[Any] = ()


class NavigationPlanner(Block):
    """A planner that takes a velocity every period and holds it in between.

    Where an input is not finite, the robot is to stand.
    """

    def declare(self, period: float, *memory: Any) -> None:
        """Declares ports, state and update.

        Args:
            period: In s.
            memory: What the planner remembers at first: named tuples of numbers.
        """
        self._robot = self.signal_in("robot", RobotState)
        self._seen = self.signal_in("seen", SEEN)
        self._goal = self.signal_in("goal", Goal)
        rest = (PlanarVelocity(0.0, 0.0), Mode())
        for name, signal in zip(("v_R", "mode"), rest, strict=True):
            self.state_out(name, type(signal), np.array(signal))
        for part in memory:
            self.DeclareDiscreteState([*part])
        self._kinds = [type(part) for part in (*rest, *memory)]
        self.update_every(period, self._update)

    def _update(self, context: Any) -> Sequence[Any]:
        robot = RobotState(*self._robot.Eval(context).tolist())
        goal = Goal(*self._goal.Eval(context).tolist())
        seen = rows(SEEN, self._seen.Eval(context))
        state = context.get_discrete_state
        _, mode, *memory = (
            kind(*state(group).value().tolist())
            for group, kind in enumerate(self._kinds)
        )
        if not isfinite(sum(robot) + sum(goal) + sum(map(sum, seen))):
            return PlanarVelocity(0.0, 0.0), mode, *memory
        there = [obstacle for obstacle in seen if obstacle.track >= 0.0]
        planned = self.plan(robot, goal, there, *memory)
        return planned.v_R, planned.mode, *planned.memory

    @abstractmethod
    def plan(
        self, robot: RobotState, goal: Goal, seen: list[Seen], *memory: Any
    ) -> Planned:
        """What is held from now on.

        Args:
            robot: The body.
            goal: Where it shall go.
            seen: The obstacles in sight.
            *memory: What the planner remembers.
        """


def velocity(robot: RobotState) -> tuple[float, float]:
    """Velocity of the body [m/s]."""
    return robot.v * cos(robot.theta), robot.v * sin(robot.theta)
