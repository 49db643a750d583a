"""The gauze's planners, the functions of their blocks, for the kinematic loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import time
from typing import Any

import numpy as np

from diagrams.gauze.kinematic_loop import Planner, Robot
from systems.auto_guidance import (
    backward_movement,
    fuzzy_arbiter,
    go_to_target,
    velocity_corrections,
)
from systems.auto_guidance.backward_movement import BackwardMovementParams
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiterParams, Weights
from systems.auto_guidance.go_to_target import GoToTargetParams, guide_point
from systems.auto_guidance.velocity_corrections import VelocityCorrectionsParams
from systems.bypass import (
    clearance_constraint,
    obstacle_tools,
    safe_velocity,
    tool_bypass,
    workspace,
)
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.obstacle_tools import Margins
from systems.bypass.tool_bypass import ToolBypassParams
from systems.bypass.workspace import WorkspaceParams
from systems.common.geometry import scaled
from systems.common.reach_limits import ReachLimits
from systems.common.signal import Vector, flat
from systems.common.signals import Estimate, Guide, RobotTool, ViewCone

ROBOT = Robot()
SPEED = ROBOT.max_speed
NO_CONE = ViewCone((0.0, 0.0, 0.2), (0.0, 0.0, -1.0), 3.2)
"""A view cone that holds everything: there is no camera in the scenes."""
ROOM = workspace.constants(
    ReachLimits(
        min_insertion=ROBOT.least_insertion,
        max_insertion=0.5,
        max_tilt=3.1,
        wrist_speed=100.0,
    ),
    WorkspaceParams(floor=-0.065),
)[0]
"""The scenes' workspace."""
BYPASS = ToolBypassParams(max_speed=SPEED)
CLEARANCE = ClearanceConstraintParams(max_speed=SPEED, turning_speed=ROBOT.max_turning)
_MARGINS = obstacle_tools.constants(Margins())[0]


def around(obstacle: Estimate, others: Sequence[Estimate]) -> np.ndarray:
    """Obstacle tools (n, 11) of the estimates of O and of the further tools."""
    estimates = np.array([flat(tool) for tool in (obstacle, *others)])
    rows: np.ndarray = obstacle_tools.tool_rows(_MARGINS, estimates)
    return rows


@dataclass
class LocalPlanner:
    """The paper's local planner (Figure 4): the functions of the four blocks.

    Attributes:
        go: Parameters of go to target.
        corrections: Of the velocity corrections.
        backward: Of the backward movement.
        arbiter: Of the fuzzy arbiter.
        field_only: Commands v_1 alone, for comparison.
        v1, v2, v3, v_R: The last step's velocities of the guide point, m/s.
        guide: The last step's guide.
        weights: The last step's weights.
    """

    go: GoToTargetParams = field(default_factory=GoToTargetParams)
    corrections: VelocityCorrectionsParams = field(
        default_factory=VelocityCorrectionsParams
    )
    backward: BackwardMovementParams = field(default_factory=BackwardMovementParams)
    arbiter: FuzzyArbiterParams = field(default_factory=FuzzyArbiterParams)
    field_only: bool = False

    def __post_init__(self) -> None:
        """Starts from rest."""
        self._go = go_to_target.constants(self.go)[0]
        self._corrections = velocity_corrections.constants(self.corrections)[0]
        self._backward = backward_movement.constants(self.backward)[0]
        self._arbiter = fuzzy_arbiter.constants(self.arbiter)[0]
        self._v1_tip: Vector = (0.0, 0.0, 0.0)
        self._v_tip: Vector = (0.0, 0.0, 0.0)
        self.v3: Vector = (0.0, 0.0, 0.0)

    def step(
        self,
        dt: float,
        robot: RobotTool,
        obstacle: Estimate,
        target: Estimate,
        others: Sequence[Estimate] = (),
    ) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        self._v1_tip, self.guide = self._go_to_target(
            dt, robot, obstacle, target, others
        )
        s = self.guide.s
        self.v1 = scaled(s, self._v1_tip)
        if self.field_only:
            self.v2, self.v_R = (0.0, 0.0, 0.0), self.v1
            self.weights = Weights(1.0, 0.0, 0.0)
            return self._v1_tip
        self.v2 = velocity_corrections.velocity_correction(
            self._corrections, self.v1, self.guide, obstacle
        )
        self.v3 = backward_movement.backward_movement(
            self._backward, self.v3, dt, self.guide, obstacle
        )
        self.weights, self._v_tip, _ = fuzzy_arbiter.arbitrate(
            self._arbiter,
            self._v_tip,
            dt,
            (self.v1, self.v2, self.v3),
            self.guide,
            robot,
            obstacle,
            target,
        )
        self.v_R = scaled(s, self._v_tip)
        return self._v_tip

    def _go_to_target(
        self,
        dt: float,
        robot: RobotTool,
        obstacle: Estimate,
        target: Estimate,
        others: Sequence[Estimate],
    ) -> tuple[Vector, Guide]:
        """v_1 / s and the guide; another form of the behaviour goes here."""
        return go_to_target.go_to_target(
            self._go, self._v1_tip, dt, robot, obstacle, target
        )


@dataclass
class Bypass(LocalPlanner):
    """The bypass in place of the potential field, alone or under the fuzzy sum."""

    bypass: ToolBypassParams = field(default_factory=lambda: BYPASS)

    def __post_init__(self) -> None:
        """Starts from rest, on the straight way."""
        super().__post_init__()
        self._bypass = tool_bypass.constants(self.bypass)[0]
        self.edge, self.waits, self.edge_switches = 0, 0, 0

    def _go_to_target(
        self,
        dt: float,
        robot: RobotTool,
        obstacle: Estimate,
        target: Estimate,
        others: Sequence[Estimate],
    ) -> tuple[Vector, Guide]:
        edge = self.edge
        v_tip, self.edge, self.waits, _ = tool_bypass.bypass(
            self._bypass,
            ROOM,
            NO_CONE,
            self._v1_tip,
            dt,
            robot.fulcrum,
            robot.tip,
            target.p,
            (0.0, 0.0, 0.0),
            around(obstacle, others),
            edge,
            self.waits,
        )
        self.edge_switches += edge > 0 and self.edge > 0 and edge != self.edge
        floor = self.bypass.proportion_floor
        return v_tip, guide_point(robot, obstacle, target.p, floor)


@dataclass
class Constrained:
    """Any planner with the clearance constraint behind it.

    Attributes:
        inner: The planner.
        params: Of the constraint.
        holds: Whether the evasion condition held at all instants so far.
        seconds: Wall time of every step, s.
    """

    inner: Planner
    params: ClearanceConstraintParams = field(default_factory=lambda: CLEARANCE)
    holds: bool = True
    seconds: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Starts with nothing to dodge."""
        self._record = clearance_constraint.constants(self.params)[0]
        self._dodging = np.zeros(0)

    def step(
        self,
        dt: float,
        robot: RobotTool,
        obstacle: Estimate,
        target: Estimate,
        others: Sequence[Estimate] = (),
    ) -> Vector:
        """The velocity of the robot's tip, see `Planner`."""
        start = time.perf_counter()
        wanted = self.inner.step(dt, robot, obstacle, target, others)
        tools = around(obstacle, others)
        if not len(self._dodging):
            self._dodging = np.zeros(len(tools))
        v: Vector
        v, self._dodging, status = safe_velocity.constrain(
            self._record,
            ROOM,
            NO_CONE,
            robot.fulcrum,
            robot.tip,
            wanted,
            tools,
            self._dodging,
            np.zeros((1 + len(tools), 3)),
        )
        self.seconds.append(time.perf_counter() - start)
        if status.near:
            self.holds = self.holds and status.condition > 0.5
        return v


TRAVEL = 0.06
"""How fast the robot at the bedside travels; it evades faster, m/s."""


def traveller(params: ClearanceConstraintParams) -> Constrained:
    """A fresh planner that travels at `TRAVEL` and evades as the constraint does."""
    inner = Bypass(
        go=GoToTargetParams(max_speed=TRAVEL),
        arbiter=FuzzyArbiterParams(max_speed=TRAVEL),
        bypass=ToolBypassParams(max_speed=TRAVEL),
    )
    return Constrained(inner, params)


def robot_of(params: ClearanceConstraintParams) -> Robot:
    """The ideal robot that is as fast as its constraint reckons with."""
    return Robot(
        max_speed=params.max_speed,
        max_turning=params.turning_speed,
        max_acceleration=params.acceleration,
    )


FIELD: dict[str, Any] = {
    "go": GoToTargetParams(max_speed=SPEED),
    "arbiter": FuzzyArbiterParams(max_speed=SPEED),
}
DECISION = FuzzyArbiterParams(table="literal", velocity="v_R", max_speed=SPEED)
"""Table I to the letter, on the current v_R of Figure 4."""
WANTED = FuzzyArbiterParams(table="literal", max_speed=SPEED)
"""The same on v_1."""
PRINTED: dict[str, Any] = {
    "go": GoToTargetParams(form="printed", max_speed=SPEED),
    "backward": BackwardMovementParams(form="printed"),
    "arbiter": DECISION,
}
PLANNERS: dict[str, Callable[[], Planner]] = {
    "bypass": lambda: Constrained(Bypass(**FIELD)),
    "bypass alone": lambda: Constrained(Bypass(**FIELD, field_only=True)),
    "bypass, no constraint": lambda: Bypass(**FIELD, field_only=True),
    "corrected field": lambda: LocalPlanner(**FIELD),
    "printed field": lambda: LocalPlanner(**PRINTED),
    "literal on v_R": lambda: LocalPlanner(**FIELD | {"arbiter": DECISION}),
    "literal on v_1": lambda: LocalPlanner(**FIELD | {"arbiter": WANTED}),
    "field + constraint": lambda: Constrained(LocalPlanner(**FIELD)),
    "field only": lambda: LocalPlanner(**FIELD, field_only=True),
}
"""Each makes a fresh planner, at the scenes' speed."""
