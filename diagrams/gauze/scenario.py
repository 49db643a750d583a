"""The scenario of a gauze delivery: every block's and part's parameters."""

from dataclasses import dataclass, field, replace
import math
from typing import Any

from diagrams.bedside.bedside import ToolAtStart
from diagrams.bedside.wrist import TipSettings, WristSettings, check_wrist
from diagrams.common.scenario import Scenario, ScenarioError
from diagrams.gauze.tools import (
    CAMERA,
    OBSTACLE,
    TARGET,
    CameraTool,
    HandTool,
    Tool,
    usual_tools,
)
from plants.abdomen.abdomen import AbdomenParams
from plants.arm.arm import ArmParams
from plants.instruments.instrument import DRY_GAUZE, InstrumentParams
from plants.organs.organ_touch import OrganTouchParams
from plants.organs.organs import Organ, surface_of
from plants.surgeon.hunting_tool import Hunt
from plants.surgeon.recording import load_recording
from plants.surgeon.synthetic_hand import SyntheticHand
from systems.auto_guidance.backward_movement import BackwardMovementParams
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiterParams
from systems.auto_guidance.go_to_target import GoToTargetParams
from systems.auto_guidance.velocity_corrections import VelocityCorrectionsParams
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.obstacle_tools import Margins
from systems.bypass.tool_bypass import ToolBypassParams
from systems.bypass.workspace import WorkspaceParams
from systems.common.geometry import sub, unit
from systems.common.parameter import parameter, part
from systems.common.signal import vector
from systems.common.signals import ViewCone
from systems.motion.camera_planner import CameraPlannerParams
from systems.motion.joint_commands import JointCommandsParams
from systems.motion.tissue_press import TissuePressParams
from systems.motion.tool_navigation import (
    ToolNavigationParams,
    cone_angle,
    constants,
    reachable,
)
from systems.sensing.optical_tracker import OpticalTrackerParams
from systems.sensing.registration import RegistrationParams
from systems.sensing.tissue_force import TissueForceParams
from systems.sensing.trajectory_estimator import TrajectoryEstimatorParams

BEHAVIOURS = ("bypass", "field")
"""Attract or bypass, or the paper's sum of potentials (see `go_to_target.form`)."""


@dataclass
class GauzeScenario(Scenario, WristSettings, TipSettings):
    """Auto-guided movements (section 5 of the paper): gauze to the surgeon."""

    known_fulcrums: bool = parameter(
        False, "whether the estimators are told G_S and G_O, for comparison"
    )
    behaviour: str = parameter("bypass", 'form of "go to target"', choices=BEHAVIOURS)
    measure_from: float = parameter(
        0.0, "force figures of the wrist start here", "s", least=0.0, most=1e5
    )
    robot: ToolAtStart = part(ToolAtStart)
    tools: list[Tool] = field(default_factory=usual_tools)
    organs: list[Organ] = parameter([], "of the patient", shape=(-1,))
    camera_planner: CameraPlannerParams = part(CameraPlannerParams)
    judge_sight: bool = parameter(
        False, "whether `tips_in_view` and `camera_path` are measured"
    )
    organ_touch: OrganTouchParams = part(OrganTouchParams)
    tissue_force: TissueForceParams = part(TissueForceParams)
    press: TissuePressParams = part(TissuePressParams)
    time_ratio: bool = parameter(
        False,
        "whether it is run without O, and organs, as well, for the figure `time_ratio`",
    )
    compare: bool = parameter(
        False, "whether the paper's planner is run as well and drawn beside it"
    )
    tracker: OpticalTrackerParams = part(OpticalTrackerParams)
    registration: RegistrationParams = part(RegistrationParams)
    estimator: TrajectoryEstimatorParams = part(TrajectoryEstimatorParams)
    margins: Margins = part(Margins)
    workspace: WorkspaceParams = part(WorkspaceParams)
    tool_bypass: ToolBypassParams = part(ToolBypassParams)
    clearance_constraint: ClearanceConstraintParams = part(ClearanceConstraintParams)
    go_to_target: GoToTargetParams = part(GoToTargetParams)
    velocity_corrections: VelocityCorrectionsParams = part(VelocityCorrectionsParams)
    backward_movement: BackwardMovementParams = part(BackwardMovementParams)
    fuzzy_arbiter: FuzzyArbiterParams = part(FuzzyArbiterParams)
    navigation: ToolNavigationParams = part(ToolNavigationParams)
    joints: JointCommandsParams = part(JointCommandsParams)
    arm: ArmParams = part(ArmParams)
    # It carries the gauze from the start to S, and to the end of the run.
    instrument: InstrumentParams = part(lambda: InstrumentParams(gauze_mass=DRY_GAUZE))
    abdomen: AbdomenParams = part(AbdomenParams)

    def of_role(self, role: str) -> list[Any]:
        """The tools of a role."""
        return [tool for tool in self.tools if tool.role == role]

    @property
    def target(self) -> HandTool:
        """S."""
        tool: HandTool = self.of_role(TARGET)[0]
        return tool

    @property
    def obstacles(self) -> list[HandTool]:
        """O, and others like it."""
        return self.of_role(OBSTACLE)

    @property
    def camera(self) -> CameraTool:
        """The endoscope."""
        tool: CameraTool = self.of_role(CAMERA)[0]
        return tool

    @property
    def emulated(self) -> bool:
        """Whether the passive wrist is in the diagram: its fulcrum is not given."""
        return self.wrist != "known" or not self.wall_motion.still


LEAST_FULCRUM_DISTANCE = 0.02
"""Two trocars cannot be closer [m]."""

WITHOUT_OBSTACLE = "without obstacle"
"""Name of the run that `time_ratio` compares with."""

PAPER = "the paper's planner"
"""Name of the run that `compare` draws beside it."""

WITHDRAWN = 0.01
"""Depth of O's tip where it is out of everybody's way [m]."""


def companions(scenario: GauzeScenario) -> dict[str, GauzeScenario]:
    """With O withdrawn to its trocar for `time_ratio`, the paper's for `compare`."""
    found = {}
    alone = replace(scenario, time_ratio=False, compare=False)
    if scenario.compare:
        free = replace(scenario.clearance_constraint, active=False)
        found[PAPER] = replace(alone, behaviour="field", clearance_constraint=free)
    if not scenario.time_ratio:
        return found
    tools = [
        withdrawn(t) if isinstance(t, HandTool) and t.role == OBSTACLE else t
        for t in scenario.tools
    ]
    return found | {WITHOUT_OBSTACLE: replace(alone, tools=tools, organs=[])}


def withdrawn(tool: HandTool) -> HandTool:
    """A tool that stays just inside its trocar."""
    x, y, z = tool.p_WG
    inside = [[x, y, z - WITHDRAWN]]
    return replace(
        tool,
        times=[0.0],
        points=inside,
        recording=None,
        pushes=[],
        hunt=Hunt(),
        hand=SyntheticHand(),
        carried=[0.0, 0.0, 0.0],
    )


def check(scenario: GauzeScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    check_tools(scenario)
    check_wrist(scenario)
    check_organs(scenario)
    check_fulcrums(scenario)
    _check_reach(scenario)


def check_organs(scenario: GauzeScenario) -> None:
    """Raises an error for organs that cannot be, or for a press that has none."""
    for organ in scenario.organs:
        if organ.file:
            surface_of(organ)
    if not scenario.press.active:
        return
    if not scenario.organs:
        raise ScenarioError("press.active=True: expected organs to press on")
    if not scenario.emulated:
        raise ScenarioError(
            f"wrist={scenario.wrist!r}: expected 'pwe' with press.active, whose force "
            "loop needs the wrist's sensor"
        )
    if scenario.tip_load.active:
        raise ScenarioError(
            "tip_load.active=True: expected False with press.active, which tells what "
            "touches the tip itself"
        )


def check_tools(scenario: GauzeScenario) -> None:
    """Raises ScenarioError for tools that cannot be."""
    names = [one.name for one in (*scenario.tools, *scenario.organs)]
    for name in names:
        if names.count(name) > 1 or not name.isidentifier():
            raise ScenarioError(
                f"tools and organs {names}: expected names that differ, of letters, "
                "digits and _"
            )
    for role in (TARGET, CAMERA):
        if len(scenario.of_role(role)) != 1:
            called = [tool.name for tool in scenario.of_role(role)]
            raise ScenarioError(f"tools of role {role!r}={called}: expected one")
    if not scenario.obstacles:
        raise ScenarioError(
            f"tools={names}: expected at least one of role {OBSTACLE!r}; a tool that "
            "stays in its trocar is out of the way"
        )
    for tool in scenario.of_role(TARGET) + scenario.obstacles:
        if tool.hunt.speed and tool.recording:
            raise ScenarioError(
                f"{tool.name}.hunt.speed={tool.hunt.speed}: expected 0 together with a "
                "recording"
            )
        if tool.hunt.speed and (tool.breathes or tool.hand.seed):
            raise ScenarioError(
                f"{tool.name}.hunt.speed={tool.hunt.speed}: expected 0 together with "
                "breathing or a synthetic hand"
            )
        if tool.recording:
            second = float(load_recording(tool.recording)[0][1])
            if scenario.duration <= second:
                raise ScenarioError(
                    f"duration={scenario.duration} s: expected > {second:.4g} s, the "
                    f"second sample of {tool.name}.recording; are its times in s?"
                )


def check_fulcrums(scenario: GauzeScenario) -> None:
    """Raises ScenarioError for trocars that are too close to each other."""
    fulcrums = {"robot": scenario.robot.p_WG}
    fulcrums |= {tool.name: tool.p_WG for tool in scenario.tools}
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
    p_WG, apex = vector(scenario.robot.p_WG), vector(scenario.camera.p_WG)
    for name, point in (
        ("robot.p_WP", scenario.robot.p_WP),
        ("target.points[0]", scenario.target.points[0]),
    ):
        if not reachable(record, p_WG, vector(point)):
            raise ScenarioError(
                f"{name}={point} is out of reach through robot.p_WG="
                f"{scenario.robot.p_WG}: expected an insertion in "
                f"[{limits.min_insertion}, {limits.max_insertion}] m and a tilt of at "
                f"most {limits.max_tilt} rad"
            )
    start = scenario.target.points[0]
    axis = unit(sub(vector(scenario.camera.p_WS), apex))
    cone = ViewCone(apex, axis, scenario.camera.half_angle)
    if cone_angle(cone, vector(start)) > cone.half:
        raise ScenarioError(
            f"target.points[0]={start} lies outside the view cone of half angle "
            f"{scenario.camera.half_angle} rad about camera.p_WS={scenario.camera.p_WS}"
        )
