"""The scenario of a gauze delivery: every block's and part's parameters."""

from dataclasses import dataclass, field, replace
import math

import numpy as np

from diagrams.bedside.wrist import WristSettings, check_wrist
from diagrams.common.scenario import Scenario, ScenarioError, nearest
from plants.abdomen.abdomen import AbdomenParams
from plants.arm.arm import ArmParams
from plants.instruments.instrument import InstrumentParams
from plants.surgeon.hunting_tool import Hunt
from plants.surgeon.recording import load_recording
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.auto_guidance.backward_movement import BackwardMovementParams
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiterParams
from systems.auto_guidance.go_to_target import GoToTargetParams
from systems.auto_guidance.velocity_corrections import VelocityCorrectionsParams
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.obstacle_tools import Margins
from systems.bypass.tool_bypass import ToolBypassParams
from systems.bypass.workspace import WorkspaceParams
from systems.motion.endoscope import EndoscopeParams
from systems.motion.joint_commands import JointCommandsParams
from systems.motion.tool_navigation import (
    ToolNavigationParams,
    cone_angle,
    constants,
    reachable,
)
from systems.sensing.optical_tracker import OpticalTrackerParams
from systems.sensing.trajectory_estimator import TrajectoryEstimatorParams


@dataclass
class RobotTool:
    """Where the robot's own tool R is at the start, in W [m].

    Attributes:
        p_WG: Its fulcrum G_R, here known to the robot.
        p_WP: Its tip.
    """

    p_WG: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    p_WP: list[float] = field(default_factory=lambda: [0.0, 0.0, -0.1])


@dataclass
class GauzeScenario(Scenario, WristSettings):
    """Auto-guided movements (section 5 of the paper): gauze to the surgeon.

    Attributes:
        recording: CSV `t, x, y, z` of O's tip in W, in s and m; it takes the
            place of O's waypoints.
        known_fulcrums: Whether the estimators are told G_S and G_O, for
            comparison; else they find them from the shafts' lines.
        behaviour: Form of "go to target": "bypass" (attract or bypass), or "field"
            (the paper's sum of potentials, see `go_to_target.form`).
        time_ratio: Whether it is run without O as well, to give the figure
            `time_ratio`.
        hunt: O chases the robot's shaft, if its speed is not 0.
        measure_from: Force figures of the wrist start here [s].
    """

    recording: str = field(default="", metadata={"file": True})
    known_fulcrums: bool = False
    behaviour: str = "bypass"
    measure_from: float = 0.0
    robot: RobotTool = field(default_factory=RobotTool)
    target: SurgeonToolParams = field(default_factory=SurgeonToolParams)
    obstacle: SurgeonToolParams = field(default_factory=SurgeonToolParams)
    time_ratio: bool = False
    hunt: Hunt = field(default_factory=Hunt)
    camera: EndoscopeParams = field(default_factory=EndoscopeParams)
    tracker: OpticalTrackerParams = field(default_factory=OpticalTrackerParams)
    estimator: TrajectoryEstimatorParams = field(
        default_factory=TrajectoryEstimatorParams
    )
    margins: Margins = field(default_factory=Margins)
    workspace: WorkspaceParams = field(default_factory=WorkspaceParams)
    tool_bypass: ToolBypassParams = field(default_factory=ToolBypassParams)
    clearance_constraint: ClearanceConstraintParams = field(
        default_factory=ClearanceConstraintParams
    )
    go_to_target: GoToTargetParams = field(default_factory=GoToTargetParams)
    velocity_corrections: VelocityCorrectionsParams = field(
        default_factory=VelocityCorrectionsParams
    )
    backward_movement: BackwardMovementParams = field(
        default_factory=BackwardMovementParams
    )
    fuzzy_arbiter: FuzzyArbiterParams = field(default_factory=FuzzyArbiterParams)
    navigation: ToolNavigationParams = field(default_factory=ToolNavigationParams)
    joints: JointCommandsParams = field(default_factory=JointCommandsParams)
    arm: ArmParams = field(default_factory=ArmParams)
    instrument: InstrumentParams = field(default_factory=InstrumentParams)
    abdomen: AbdomenParams = field(default_factory=AbdomenParams)

    @property
    def emulated(self) -> bool:
        """Whether the passive wrist is in the diagram: its fulcrum is not given."""
        return self.wrist != "known" or not self.wall_motion.still


BEHAVIOURS = ("bypass", "field")

LEAST_FULCRUM_DISTANCE = 0.02
"""Two trocars cannot be closer [m]."""

WITHOUT_OBSTACLE = "without obstacle"
"""Name of the run that `time_ratio` compares with."""

WITHDRAWN = 0.01
"""Depth of O's tip where it is out of everybody's way [m]."""


def companions(scenario: GauzeScenario) -> dict[str, GauzeScenario]:
    """The same scenario with O withdrawn to its trocar, if `time_ratio` asks for it."""
    if not scenario.time_ratio:
        return {}
    x, y, z = scenario.obstacle.p_WG
    withdrawn = replace(
        scenario.obstacle,
        times=[0.0],
        points=[[x, y, z - WITHDRAWN]],
        recording=None,
        pushes=[],
    )
    alone = replace(
        scenario, obstacle=withdrawn, recording="", hunt=Hunt(), time_ratio=False
    )
    return {WITHOUT_OBSTACLE: alone}


def check(scenario: GauzeScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    for part in vars(scenario).values():
        if hasattr(part, "check"):
            part.check()
    if scenario.behaviour not in BEHAVIOURS:
        hint = nearest(scenario.behaviour, BEHAVIOURS)
        raise ScenarioError(f"behaviour={scenario.behaviour!r}: {hint}")
    if scenario.hunt.speed and scenario.recording:
        raise ScenarioError(
            f"hunt.speed={scenario.hunt.speed}: expected 0 together with a recording"
        )
    check_wrist(scenario)
    if scenario.recording:
        load_recording(scenario.recording)
    points = {
        "robot.p_WG": scenario.robot.p_WG,
        "robot.p_WP": scenario.robot.p_WP,
        "camera.p_WG": scenario.camera.p_WG,
    }
    for name, point in points.items():
        if len(point) != 3:
            raise ScenarioError(f"{name}={point}: expected 3 numbers")
    _check_fulcrums(scenario)
    _check_reach(scenario)


def _check_fulcrums(scenario: GauzeScenario) -> None:
    fulcrums = {
        "robot": scenario.robot.p_WG,
        "target": scenario.target.p_WG,
        "obstacle": scenario.obstacle.p_WG,
        "camera": scenario.camera.p_WG,
    }
    names = list(fulcrums)
    for index, one in enumerate(names):
        for other in names[index + 1 :]:
            gap = math.dist(fulcrums[one], fulcrums[other])
            if gap < LEAST_FULCRUM_DISTANCE:
                raise ScenarioError(
                    f"fulcrums {one}.p_WG={fulcrums[one]} and {other}.p_WG="
                    f"{fulcrums[other]} are {gap:.4f} m apart: expected at least "
                    f"{LEAST_FULCRUM_DISTANCE} m"
                )


def _check_reach(scenario: GauzeScenario) -> None:
    """The start and S's first tip must be reachable and in view."""
    limits = scenario.navigation
    record = constants(limits)[0]
    p_WG = scenario.robot.p_WG
    for name, point in (
        ("robot.p_WP", scenario.robot.p_WP),
        ("target.points[0]", scenario.target.points[0]),
    ):
        if not reachable(record, tuple(p_WG), tuple(point)):
            raise ScenarioError(
                f"{name}={point} is out of reach through robot.p_WG="
                f"{scenario.robot.p_WG}: expected an insertion in "
                f"[{limits.min_insertion}, {limits.max_insertion}] m and a tilt of at "
                f"most {limits.max_tilt} rad"
            )
    apex = scenario.camera.p_WG
    start = scenario.target.points[0]
    axis = [p - a for p, a in zip(scenario.camera.p_WS, apex, strict=True)]
    length = math.hypot(*axis)
    half_angle = scenario.camera.half_angle
    cone = np.array([*apex, *(x / length for x in axis), half_angle])
    if cone_angle(cone, tuple(start)) > scenario.camera.half_angle:
        raise ScenarioError(
            f"target.points[0]={start} lies outside the view cone of half angle "
            f"{scenario.camera.half_angle} rad about camera.p_WS={scenario.camera.p_WS}"
        )
