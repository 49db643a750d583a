"""The planners of the bypass benchmark, as the kinematic loop takes them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import time

import numpy as np

from systems.auto_guidance.backward_movement import BackwardMovementParams
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiterParams
from systems.auto_guidance.go_to_target import GoToTargetParams, guide_point
from systems.bypass import (
    clearance_constraint,
    obstacle_tools,
    tool_bypass,
    workspace,
)
from systems.bypass.bypass_route import up_and_over
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.obstacle_tools import Margins
from systems.bypass.tool_bypass import ToolBypassParams
from systems.bypass.workspace import WorkspaceParams
from systems.common.geometry import Vector, along, limited, sub
from tests.benchmarks.kinematic_loop import LocalPlanner, Planner, Robot

ROBOT = Robot()
SPEED = ROBOT.max_speed
NO_CONE = np.array([0.0, 0.0, 0.2, 0.0, 0.0, -1.0, 3.2])
"""A view cone that holds everything: there is no camera in the scenes."""
ROOM = WorkspaceParams(
    min_insertion=ROBOT.least_insertion, max_insertion=0.5, max_tilt=3.1, floor=-0.065
)
BYPASS = ToolBypassParams(max_speed=SPEED)
CLEARANCE = ClearanceConstraintParams(max_speed=SPEED, turning_speed=ROBOT.max_turning)
MARGINS = Margins()
_ROOM = workspace.constants(ROOM)[0]
_MARGINS = obstacle_tools.constants(MARGINS)[0]


def around(obstacle: np.ndarray, others: Sequence[np.ndarray]) -> np.ndarray:
    """Obstacle tools (n, 11) of the estimates of O and of the further tools."""
    return obstacle_tools.tool_rows(_MARGINS, np.array([obstacle, *others]))


@dataclass
class Bypass(LocalPlanner):
    """The bypass in place of the potential field, alone or under the fuzzy sum."""

    bypass: ToolBypassParams = field(default_factory=lambda: BYPASS)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._bypass = tool_bypass.constants(self.bypass)[0]
        self.edge, self.waits, self.edge_switches = 0, 0, 0
        self.aim: Vector = (0.0, 0.0, 0.0)

    def _go_to_target(self, dt, robot_tool, obstacle, target, others):
        g, p, goal = (tuple(x) for x in (robot_tool[:3], robot_tool[3:], target[:3]))
        edge = self.edge
        v_tip, self.edge, self.waits, self.aim = tool_bypass.bypass(
            self._bypass,
            _ROOM,
            NO_CONE,
            self._v1_tip,
            dt,
            g,
            p,
            goal,
            (0.0, 0.0, 0.0),
            around(obstacle, others),
            edge,
            self.waits,
        )
        self.edge_switches += edge > 0 and self.edge > 0 and edge != self.edge
        return v_tip, guide_point(
            robot_tool, obstacle, goal, self.bypass.proportion_floor
        )


class Straight:
    """Attraction alone, with the bypass's law of speed."""

    def __init__(self) -> None:
        self._v: Vector = (0.0, 0.0, 0.0)

    def step(self, dt, robot_tool, obstacle, target, others=()) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        way = sub(target[:3], robot_tool[3:])
        rate = BYPASS.approach_rate
        wanted = limited((rate * way[0], rate * way[1], rate * way[2]), SPEED)
        change = limited(sub(wanted, self._v), BYPASS.max_acceleration * dt)
        self._v = along(self._v, 1.0, change)
        return self._v


class RetractTurnInsert:
    """Up and over everything, always: the complete fallback by itself."""

    def __init__(self) -> None:
        self._params = tool_bypass.constants(BYPASS)[0]

    def step(self, dt, robot_tool, obstacle, target, others=()) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        g, p, goal = (tuple(x) for x in (robot_tool[:3], robot_tool[3:], target[:3]))
        tools = around(obstacle, others)
        keep = np.full(len(tools), MARGINS.safe_distance + BYPASS.goal_slack)
        direction, length = up_and_over(tools, keep, ROOM.min_insertion, g, p, goal)
        speed = min(SPEED, BYPASS.approach_rate * length)
        return along((0.0, 0.0, 0.0), speed, direction)


@dataclass
class Constrained:
    """Any planner with the clearance constraint behind it.

    Attributes:
        inner: The planner.
        params: Of the constraint.
        holds: Whether the evasion condition held at all instants so far.
        near: Instants with a tool near.
        held: Those of them at which the condition held.
        seconds: Wall time of every step, s.
    """

    inner: Planner
    params: ClearanceConstraintParams = field(default_factory=lambda: CLEARANCE)
    holds: bool = True
    near: int = 0
    held: int = 0
    seconds: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._record = clearance_constraint.constants(self.params)[0]
        self._dodging = np.zeros(clearance_constraint.TOOLS)
        self.status = np.zeros(6)

    def step(self, dt, robot_tool, obstacle, target, others=()) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        start = time.perf_counter()
        wanted = self.inner.step(dt, robot_tool, obstacle, target, others)
        g, p = tuple(robot_tool[:3]), tuple(robot_tool[3:])
        v, self._dodging, self.status = clearance_constraint.constrain(
            self._record,
            _ROOM,
            NO_CONE,
            g,
            p,
            wanted,
            around(obstacle, others),
            self._dodging,
        )
        self.seconds.append(time.perf_counter() - start)
        if self.status[1]:
            self.near += 1
            self.held += int(self.status[2])
            self.holds = self.holds and self.status[2] > 0.5
        return v


FIELD = {
    "go": GoToTargetParams(max_speed=SPEED),
    "arbiter": FuzzyArbiterParams(max_speed=SPEED),
}
PRINTED = {
    "go": GoToTargetParams(form="printed", max_speed=SPEED),
    "backward": BackwardMovementParams(form="printed"),
    "arbiter": FuzzyArbiterParams(table="literal", max_speed=SPEED),
}
PLANNERS: dict[str, Callable[[], Planner]] = {
    "bypass": lambda: Constrained(Bypass(**FIELD)),
    "bypass alone": lambda: Constrained(Bypass(**FIELD, field_only=True)),
    "bypass, no constraint": lambda: Bypass(**FIELD, field_only=True),
    "corrected field": lambda: LocalPlanner(**FIELD),
    "printed field": lambda: LocalPlanner(**PRINTED),
    "field + constraint": lambda: Constrained(LocalPlanner(**FIELD)),
    "straight + constraint": lambda: Constrained(Straight()),
    "retract, turn, insert": lambda: Constrained(RetractTurnInsert()),
}
