"""The base of the mobile robot's planners: their ports, and what they hold."""

from abc import abstractmethod
from collections.abc import Sequence
from math import cos, isfinite, sin
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.signals import RobotState
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import check
from systems.common.signal import reader, size
from systems.switching.signals import (
    CORNERS,
    EDGES,
    SEEN,
    Corner,
    Goal,
    Mode,
    PlanarVelocity,
    Seen,
)

PERIOD = 0.05
"""Of all planners, in s."""

SEEN_SIZE = size(Seen)
SHAPE = (EDGES, size(Corner))
NO_CORNERS = np.zeros(size(CORNERS))
read_seen = reader(Seen)


class Planned(NamedTuple):
    """What is held until the next step: velocity, mode, and the planner's memory."""

    v_R: PlanarVelocity
    mode: Mode
    memory: Sequence[Any] = ()


@compiled
def in_sight(
    robot: np.ndarray, goal: np.ndarray, seen: np.ndarray, corners: np.ndarray
) -> tuple[bool, np.ndarray]:
    """Whether all numbers are finite; the rows of `Seen` that hold an obstacle."""
    rows = seen.reshape((len(seen) // SEEN_SIZE, SEEN_SIZE))
    there, count = np.empty_like(rows), 0
    for k in range(len(rows)):
        if read_seen(rows[k]).track >= 0.0:
            there[count] = rows[k]
            count += 1
    total = robot.sum() + goal.sum() + seen.sum() + corners.sum()
    return isfinite(total), there[:count]


class NavigationPlanner(Block):
    """A planner that takes a velocity every period and holds it in between.

    Where an input is not finite, the robot is to stand.
    """

    def __init__(self, params: Any, period: float, *memory: Any) -> None:
        """Declares ports, state and update.

        Args:
            params: A dataclass of the planner's parameters.
            period: In s.
            memory: What the planner remembers at first: named tuples of numbers.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.params, self.period = check(params), period
        self._robot = self.signal_in("robot", RobotState)
        self._seen = self.signal_in("seen", SEEN)
        self._goal = self.signal_in("goal", Goal)
        self._corners = self.signal_in("corners", CORNERS)
        self.state_out("v_R", PlanarVelocity, np.zeros(size(PlanarVelocity)))
        self._mode = self.state_out("mode", Mode, np.array(Mode()))
        self._memory = [self.DeclareDiscreteState([*part]) for part in memory]
        self._kinds = [PlanarVelocity, Mode, *map(type, memory)]
        self.update_every(period, self._update)

    def _update(self, context: Any) -> Sequence[Any]:
        robot, goal = self._robot.Eval(context), self._goal.Eval(context)
        hiding = NO_CORNERS
        if self._corners.HasValue(context):
            hiding = self._corners.Eval(context)
        known, there = in_sight(robot, goal, self._seen.Eval(context), hiding)
        memory = [self._held(context, group) for group in self._memory]
        if known:
            planned = self.plan(
                RobotState(*robot.tolist()),
                Goal(*goal.tolist()),
                [*map(Seen._make, there.tolist())],
                [
                    c
                    for c in map(Corner._make, hiding.reshape(SHAPE).tolist())
                    if c.there
                ],
                *memory,
            )
        else:
            mode = self._held(context, self._mode)
            planned = Planned(PlanarVelocity(0.0, 0.0), mode, memory)
        # Drake takes an array over ten times faster than a tuple.
        return [*map(np.array, (planned.v_R, planned.mode, *planned.memory))]

    def _held(self, context: Any, group: int) -> Any:
        return self._kinds[group](*context.get_discrete_state(group).value().tolist())

    @abstractmethod
    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """What is held from now on.

        Args:
            robot: The body.
            goal: Where it shall go.
            seen: The obstacles in sight.
            corners: Behind which somebody may be.
            *memory: What the planner remembers.
        """


@compiled
def velocity(robot: RobotState) -> tuple[float, float]:
    """Velocity of the body [m/s]."""
    return robot.v * cos(robot.theta), robot.v * sin(robot.theta)
