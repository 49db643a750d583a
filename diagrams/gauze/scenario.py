"""The scenario of a gauze delivery: every block's and part's parameters."""

from dataclasses import dataclass, field, replace
from itertools import combinations
import math
from typing import Any

from diagrams.bedside.bedside import ToolAtStart
from diagrams.bedside.wrist import TipSettings, WristSettings
from diagrams.common.scenario import Scenario
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
from plants.surgeon.held_tools import HeldToolsParams
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
from systems.common.parameter import Rules, parameter, part, value_of
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
from systems.motion.touch_yield import TouchYieldParams
from systems.sensing.optical_tracker import OpticalTrackerParams
from systems.sensing.registration import RegistrationParams
from systems.sensing.tissue_force import TissueForceParams
from systems.sensing.touch_watch import TouchWatchParams
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
    linger: float = parameter(
        0.0,
        "that it goes on after the gauze is there and all hands are at rest; 0: till "
        "its duration is over",
        "s",
        least=0.0,
        most=1e3,
    )
    robot: ToolAtStart = part(ToolAtStart)
    tools: list[Tool] = field(default_factory=usual_tools)
    held_tools: HeldToolsParams = part(HeldToolsParams)
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
    touch_watch: TouchWatchParams = part(TouchWatchParams)
    touch_yield: TouchYieldParams = part(TouchYieldParams)
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
        """Whether wrist sensor and passive wrist are in the diagram.

        They are where the fulcrum is not given, and where tools can touch.
        """
        told = self.wrist == "known" and self.wall_motion.still
        return not told or self.held_tools.active

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield from tool_rules(self)
        yield from super().rules()
        yield from organ_rules(self)
        yield from contact_rules(self)
        yield from reach_rules(self)


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
        guided=None,
        tracked=None,
        pushes=[],
        hunt=Hunt(),
        hand=SyntheticHand(),
        carried=[0.0, 0.0, 0.0],
    )


def organ_rules(scenario: GauzeScenario) -> Rules:
    """Organs' surfaces can be read, and a press has an organ and the wrist's sensor."""
    for organ in scenario.organs:
        if organ.file:
            surface_of(organ)
    press = scenario.press.active
    yield not press or bool(scenario.organs), "organs", "one to press on: press.active"
    felt = not press or scenario.organ_touch.acts
    yield felt, "organ_touch.acts", "true with press.active, which feels the tissue"
    sensed = not press or scenario.emulated
    yield sensed, "wrist", "'pwe' with press.active, whose force loop needs its sensor"
    alone = not (press and scenario.tip_load.active)
    told = "False with press.active, which tells what touches the tip itself"
    yield alone, "tip_load.active", told
    felt = scenario.emulated or not scenario.instrument.bending_stiffness
    yield felt, "wrist", "'pwe' with instrument.bending_stiffness: it feels the bend"
    bends = scenario.emulated or not scenario.shaft_bend.active
    yield bends, "shaft_bend.active", "False without the wrist's sensor: wrist=known"


def contact_rules(scenario: GauzeScenario) -> Rules:
    """Who gives way feels; does not press; and what is held is led by a hand."""
    gives_way = scenario.touch_yield.active
    told = (
        "'pwe' with touch_yield.active: a push is told by its moment about the fulcrum"
    )
    yield not gives_way or scenario.wrist == "pwe", "wrist", told
    # Tried with a wall that breathes evenly; nothing else is known of.
    wall = scenario.wall_motion
    breathes = replace(wall, breathing=[0.0, 0.0, 0.0]).still
    even = breathes and not (wall.irregular.disturbed or wall.curve)
    rests = even and not scenario.abdomen.turning_stiffness
    told = "False where the wall does more than breathe, or the trocar resists turning"
    yield not gives_way or rests, "touch_yield.active", told
    bends = scenario.instrument.bending_stiffness or scenario.shaft_bend.active
    told = "False with a shaft that bends: the two have not been tried together"
    yield not (scenario.held_tools.active and bends), "held_tools.active", told
    told = "False with press.active, whose own touch it would take for a push"
    yield not (gives_way and scenario.press.active), "touch_yield.active", told
    for tool in scenario.obstacles:
        led = not (scenario.held_tools.active and tool.tracked is not None)
        told = f"no {tool.name}.tracked with held_tools.active: it cannot be pushed"
        yield led, "tools", told


def tool_rules(scenario: GauzeScenario) -> Rules:
    """Tools have names of their own, one is the target and one the camera."""
    names = [one.name for one in (*scenario.tools, *scenario.organs)]
    differ = len(set(names)) == len(names) and all(map(str.isidentifier, names))
    told = f"names that differ, of letters, digits and _, not {names}"
    yield differ, "tools", told
    for role in (TARGET, CAMERA):
        called = [tool.name for tool in scenario.of_role(role)]
        yield len(called) == 1, "tools", f"one of role {role!r}, not {called}"
    told = f"one of role {OBSTACLE!r}; one that stays in its trocar is out of the way"
    yield bool(scenario.obstacles), "tools", told
    for tool in scenario.of_role(TARGET) + scenario.obstacles:
        if tool.recording:
            second = float(load_recording(tool.recording)[0][1])
            told = f"> {second:.4g} s, the second sample of {tool.name}.recording"
            yield scenario.duration > second, "duration", f"{told}; are its times in s?"
    fulcrums = {"robot": scenario.robot.p_WG}
    fulcrums |= {tool.name: tool.p_WG for tool in scenario.tools}
    for one, other in combinations(fulcrums, 2):
        gap = math.dist(fulcrums[one], fulcrums[other])
        told = f"trocars >= {LEAST_FULCRUM_DISTANCE} m apart"
        pair = f"{one}.p_WG and {other}.p_WG are {gap:.4f}"
        yield gap >= LEAST_FULCRUM_DISTANCE, "tools", f"{told}, {pair}"


def reach_rules(scenario: GauzeScenario) -> Rules:
    """The start and S's first tip are within reach, and the latter in view."""
    limits, camera = scenario.navigation, scenario.camera
    record = constants(limits)[0]
    p_WG, apex = vector(scenario.robot.p_WG), vector(camera.p_WG)
    told = (
        f"within reach through robot.p_WG={scenario.robot.p_WG}, an insertion in "
        f"[{limits.min_insertion}, {limits.max_insertion}] m and a tilt of at most "
        f"{limits.max_tilt} rad"
    )
    for key in ("robot.p_WP", "target.points[0]"):
        yield reachable(record, p_WG, vector(value_of(scenario, key))), key, told
    cone = ViewCone(apex, unit(sub(vector(camera.p_WS), apex)), camera.half_angle)
    seen = cone_angle(cone, vector(scenario.target.points[0])) <= cone.half
    told = f"in the camera's view, {cone.half:.3g} rad about camera.p_WS={camera.p_WS}"
    yield seen, "target.points[0]", told
