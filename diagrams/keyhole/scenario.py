"""The scenario of an operation through one trocar: all parameters, and checks."""

from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from diagrams.bedside.bedside import ToolAtStart
from diagrams.bedside.wrist import WRIST_BLOCKS, WristSettings, share_instants
from diagrams.common.scenario import Scenario, ScenarioError
from diagrams.gauze.scenario import GauzeScenario, tool_rules
from diagrams.gauze.tools import CameraTool
from diagrams.resection.scenario import ResectionScenario
from plants.abdomen.abdomen import AbdomenParams
from plants.abdomen.organ_motion import OrganMotionParams
from plants.arm.arm import ArmParams
from plants.instruments.instrument import InstrumentParams
from plants.instruments.tube import TubeParams
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.parameters import SnakeParams
from plants.snake.reachability import why_not
from plants.surgeon.recording import load_recording
from plants.tissue.volume import Access
from systems.bypass.obstacle_tools import Margins
from systems.common.geometry import pose_of
from systems.common.parameter import Rules, parameter, part
from systems.common.reach_limits import ReachLimits
from systems.keyhole.phases import PhasesParams
from systems.keyhole.snake_task import FAR, SnakeTaskParams, body_deviation
from systems.keyhole.tube_task import TubeTaskParams
from systems.motion.joint_commands import JointCommandsParams
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.navigation_monitor import NavigationMonitorParams
from systems.passive_wrist.sensor_zero import SensorZeroParams
from systems.passive_wrist.wrist_law import WristParams
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.tip_reference import CircleParams, circle_target
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.sensing.optical_tracker import MarkerBody, OpticalTrackerParams
from systems.sensing.organ_estimator import OrganEstimatorParams
from systems.sensing.tool_wrench import ToolWrenchParams
from systems.sensing.wrench_watch import WrenchWatchParams

TASKS = ("circle", "resect")
PERIOD = 1.0 / 60.0
"""Of all blocks, the tracker's."""
CLOCKED = (
    *("joints", "operation", "organ_estimator", "phases", "tube_task", "snake_task"),
    "sensor_zero",
    *WRIST_BLOCKS,
)
"""Blocks that share their instants."""
BASE = 2e-3
"""How far the snake's base may stand within the tube at work, in m."""
BENT = (-0.015, 0.2, -0.3, 0.3, 0.2, 0.4, -0.1)
"""A posture as plans have them, as far in as they go."""
TURN = 120
"""Postures of a turn of the circle."""


@dataclass
class QuickIk(ResectionIkParams):
    """Quick enough to follow an organ."""

    bend_rate: float = parameter(
        4.0, "largest rate of a or b of a ball", "rad/s", least=0.01, most=10.0
    )
    travel_rate: float = parameter(
        0.06, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )


@dataclass
class QuickDrums(WireDrumsParams):
    """Quick enough to follow an organ."""

    wire_rate: float = parameter(
        0.1, "largest speed of a wire", "m/s", least=1e-3, most=1.0
    )
    travel_rate: float = parameter(
        0.08, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )


@dataclass
class OrganOperation(ResectionScenario):
    """A resection whose frame is the organ's, with more room for what it misses."""

    access: Access = part(lambda: Access(direction=[0.0, 0.0, -1.0]))
    automatic: bool = parameter(True, "whether the planner goes on after procedures")
    clearance: float = parameter(
        0.15e-3, "between body and tissue in the plan", "m", least=0.0, most=0.01
    )
    accuracy: float = parameter(
        0.05e-3,
        "by which the plan takes the tool for smaller where it frees space",
        "m",
        least=0.0,
        most=0.01,
    )
    period: float = parameter(
        PERIOD,
        "of drums and inverse kinematics, the joints'",
        "s",
        least=1e-3,
        most=0.1,
    )
    resection_ik: QuickIk = part(QuickIk)
    drums: QuickDrums = part(QuickDrums)


@dataclass
class OrganMarkers(MarkerBody):
    """Markers on the organ itself: 0.1 mm of white noise along each axis."""

    noise: float = parameter(
        3.5e-4, "rms error of one marker in three dimensions", "m", least=0, most=0.01
    )
    lever: float = parameter(
        0.0, "from the markers' mean to the entry", "m", least=0, most=2
    )


@dataclass
class OrganTracker(OpticalTrackerParams):
    """What sees the organ, 33 ms late."""

    latency: float = parameter(
        1 / 30, "until a frame is delivered", "s", least=0, most=1
    )
    body: OrganMarkers = part(OrganMarkers)


@dataclass
class SteadyFulcrum(FulcrumParams):
    """For minutes under a tip that follows an organ."""

    steady: bool = parameter(
        True, "whether it is kept from drifting along the shaft, over minutes"
    )
    # A ventilator's wave is sharp; the arm runs ahead by the velocity that is foreseen.
    harmonics: int = parameter(4, "of the breathing", least=1, most=4)
    period: float = parameter(PERIOD, "of the estimate", "s", above=0.0, most=0.1)


@dataclass
class WideMargins(Margins):
    """A tube of 10 mm needs 2.5 mm more than an instrument of 5."""

    safe_distance: float = parameter(
        0.0095, "D_safe, that is held", "m", least=0.005, most=0.03
    )
    plan_distance: float = parameter(
        0.012, "D, that ways are planned with", "m", least=0.005, most=0.05
    )
    camera_distance: float = parameter(
        0.012, "D_safe of the endoscope", "m", least=0.0075, most=0.05
    )
    avoid_target: bool = parameter(False, "the station has no shaft to be avoided")


@dataclass
class Theatre(GauzeScenario):
    """The surgeon's tools, and the local planner that leads round them.

    The station takes the place of the target; the tool called target is withdrawn.
    """

    margins: WideMargins = part(WideMargins)

    def rules(self) -> Rules:
        """Those of its tools count only where they are there, see `others`."""
        yield from ()


@dataclass
class Entry:
    """Where the organ is entered, the breath in its middle."""

    p_WE: list[float] = parameter(
        [0.0, 0.0, -0.12], "the entry", "m", least=-0.5, most=0.5, shape=(3,)
    )


def clocked(kind: Any, **more: Any) -> Any:
    """A field that holds the parameters of a block on the common clock."""
    return part(lambda: kind(period=PERIOD, **more))


@dataclass
class KeyholeScenario(Scenario, WristSettings):
    """One patient, one plant: tube and snake through the trocar of who breathes."""

    task: str = parameter("circle", "what the tool does in the organ", choices=TASKS)
    others: bool = parameter(
        False, "whether the surgeon's tools are there, and are planned round"
    )
    theatre: Theatre = part(Theatre)
    robot: ToolAtStart = part(ToolAtStart)
    entry: Entry = part(Entry)
    fulcrum_estimator: SteadyFulcrum = part(SteadyFulcrum)
    organ_motion: OrganMotionParams = part(OrganMotionParams)
    organ_tracker: OrganTracker = part(OrganTracker)
    organ_estimator: OrganEstimatorParams = clocked(OrganEstimatorParams)
    phases: PhasesParams = clocked(PhasesParams)
    tube_task: TubeTaskParams = clocked(TubeTaskParams)
    snake_task: SnakeTaskParams = clocked(SnakeTaskParams)
    tool_wrench: ToolWrenchParams = clocked(ToolWrenchParams)
    sensor_zero: SensorZeroParams = clocked(SensorZeroParams)
    wrench_watch: WrenchWatchParams = clocked(WrenchWatchParams)
    navigation_monitor: NavigationMonitorParams = clocked(NavigationMonitorParams)
    # Half of an instrument's: the snake's couplers feel what the tube's end does.
    passive_wrist: WristParams = clocked(
        WristParams, wrist_acceleration=2.5, slides=True
    )
    circle: CircleParams = part(CircleParams)
    operation: OrganOperation = part(OrganOperation)
    joints: JointCommandsParams = clocked(JointCommandsParams, roll=2.1)
    arm: ArmParams = part(ArmParams)
    instrument: TubeParams = part(TubeParams)
    # Taken as 100 g: CENIC takes the bushing's damper explicitly, and h D / m must stay
    # below 2; with 20 g arm and trocar shake themselves up.
    abdomen: AbdomenParams = part(lambda: AbdomenParams(sleeve_mass=0.1))

    def rules(self) -> Rules:
        """What must hold across fields."""
        gap = self.instrument.gap
        far = self.tube_task.standoff >= gap
        yield far, "tube_task.standoff", f">= instrument.gap={gap} m"
        yield from share_instants(self, CLOCKED)
        yield from reach_rules(self)
        if self.task == "resect":
            yield from clearance_rules(self)
        if self.task == "circle":
            circle_postures(self)
        posed = not self.theatre.held_tools.active
        posed = posed and not self.theatre.touch_yield.active
        yield posed, "theatre.held_tools.active", "False: here tools have no contact"
        if self.others:
            for holds, key, expected in tool_rules(self.surgeon):
                ours = key if key == "duration" else f"theatre.{key}"
                yield holds, ours, expected
        if self.organ_motion.recording:
            load_recording(self.organ_motion.recording)

    @property
    def axis(self) -> np.ndarray:
        """z_E, from the trocar to the entry, both at rest, (3,)."""
        z = np.subtract(self.entry.p_WE, self.robot.p_WG)
        return z / np.linalg.norm(z)

    @property
    def x_axis(self) -> np.ndarray:
        """x_E, as near to the world's x as it goes, (3,)."""
        x = np.array([1.0, 0.0, 0.0]) - self.axis[0] * self.axis
        return x / np.linalg.norm(x)

    @property
    def R_WE(self) -> np.ndarray:
        """Orientation of E."""
        return np.column_stack(
            [self.x_axis, np.cross(self.axis, self.x_axis), self.axis]
        )

    @property
    def planned(self) -> OrganOperation:
        """The resection with a snake whose base stays out of the tube."""
        snake = self.operation.snake
        travel = [-self.instrument.gap - BASE, snake.travel[1]]
        player = replace(self.operation.player, lead=self.operation.period)
        return replace(
            self.operation,
            seed=self.seed,
            snake=replace(snake, travel=travel),
            player=player,
        )

    @property
    def surgeon(self) -> Theatre:
        """The theatre with the robot and the patient of this scenario."""
        return replace(
            self.theatre,
            seed=self.seed,
            duration=self.duration,
            wrist="pwe",
            robot=self.robot,
            instrument=InstrumentParams(length=self.instrument.length),
            tools=[
                replace(tool, p_WS=self.entry.p_WE)
                if isinstance(tool, CameraTool)
                else tool
                for tool in self.theatre.tools
            ],
        )

    @property
    def in_tube(self) -> SnakeParams:
        """The snake with the stroke that it has in its tube."""
        snake = self.operation.snake
        return replace(snake, travel=[-self.instrument.gap - 0.06, snake.travel[1]])


def circle_postures(scenario: KeyholeScenario) -> tuple[np.ndarray, np.ndarray]:
    """Postures of a turn of the circle and its times, at full speed.

    Raises:
        ScenarioError: If it is out of the snake's reach; where, and why.
    """
    circle = replace(scenario.circle, ramp=1e-6)
    times = np.linspace(0.0, circle.period, TURN + 1)
    poses = [circle_target(circle, t) for t in times]
    solved = [tool_postures(*pose, scenario.in_tube) for pose in poses]
    for pose, one in zip(poses, solved, strict=True):
        if not one.reached:
            raise ScenarioError(f"circle: {why_not(*pose, scenario.in_tube)}")
    return np.array([one.x for one in solved]), times


def reach_rules(scenario: KeyholeScenario) -> Rules:
    """The tube begins in its trocar; the two reach the station over a breath."""
    limits, tube = ReachLimits(), scenario.instrument
    down = np.subtract(scenario.robot.p_WP, scenario.robot.p_WG)
    inside = float(np.linalg.norm(down))
    told = (
        f"{limits.min_insertion} to {limits.max_insertion} m inside the trocar at "
        f"{scenario.robot.p_WG}, {math.degrees(limits.max_tilt):.0f} deg at most off "
        "its vertical"
    )
    upright = -down[2] >= inside * math.cos(limits.max_tilt)
    begins = limits.min_insertion <= inside <= limits.max_insertion and upright
    yield begins, "robot.p_WP", told
    depth = math.dist(scenario.entry.p_WE, scenario.robot.p_WG)
    low = limits.min_insertion + scenario.tube_task.standoff
    high = limits.max_insertion + tube.gap
    near = low <= depth <= high
    told = f"it {low:.3f} to {high:.3f} m from the trocar, not {depth:.3f}; "
    yield near, "entry.p_WE", "" if near else told + better_trocars(scenario)
    tilt = math.acos(max(-1.0, min(1.0, -scenario.axis[2])))
    near = tilt <= limits.max_tilt
    told = (
        f"it within {math.degrees(limits.max_tilt):.0f} deg of the trocar's vertical, "
        f"not {math.degrees(tilt):.0f}; "
    )
    yield near, "entry.p_WE", "" if near else told + better_trocars(scenario)
    least = depth - tube.gap + 0.02 + tube.mount_length
    told = f">= {least:.3f}: the tube is too short, its mount would meet the trocar"
    yield tube.length >= least, "instrument.length", told


def tube_tilt(scenario: KeyholeScenario) -> float:
    """Greatest angle of the tube at its station against z_E over a breath, in rad."""
    wall, organ, z = scenario.wall_motion, scenario.organ_motion, scenario.axis
    station = np.array(scenario.entry.p_WE) - scenario.tube_task.standoff * z
    most = 0.0
    for t in np.linspace(0.0, 1.0 / wall.rate, 49).tolist():
        p_WG = np.add(scenario.robot.p_WG, wall.displacement(t))
        u = station + organ.displacement(t, wall) - p_WG
        most = max(most, math.acos(min(1.0, float(z @ u / np.linalg.norm(u)))))
    return most


def clearance_rules(scenario: KeyholeScenario) -> Rules:
    """The plan has room for what the tube's tilt does to the snake's body."""
    o, angle, gap = scenario.operation, tube_tilt(scenario), scenario.instrument.gap
    room = f"<= operation.clearance={o.clearance} m, the room that the plan has"
    yield scenario.phases.deviation <= o.clearance, "phases.deviation", room
    c, s = math.cos(angle), math.sin(angle)
    E = pose_of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    C = pose_of((gap * s, 0.0, gap * (c - 1.0)), (c, 0.0, -s), (s, 0.0, c))
    geometry = o.snake.half_pitch, o.snake.tool_offset, o.snake.max_bend
    away = body_deviation(np.array(BENT), C, E, *geometry)
    tilted = f"wall and organ tilt the tube by {math.degrees(angle):.1f} deg"
    told = f"less, or more in phase: {tilted}, which the snake cannot make up for"
    yield away < FAR, "organ_motion.breathing", told
    told = (
        f">= {away:.2g} m, by which the body leaves its plan when {tilted}; or motions "
        "more in phase"
    )
    yield away <= o.clearance, "operation.clearance", told


def better_trocars(scenario: KeyholeScenario) -> str:
    """Which places on the wall would do, in words."""
    limits = ReachLimits()
    x, y, z = scenario.entry.p_WE
    down = scenario.robot.p_WG[2] - z
    low = limits.min_insertion + scenario.tube_task.standoff
    high = limits.max_insertion + scenario.instrument.gap
    far = min(math.sqrt(max(high**2 - down**2, 0.0)), down * math.tan(limits.max_tilt))
    near = math.sqrt(max(low**2 - down**2, 0.0))
    if far <= near or down <= 0.0:
        return f"no trocar at this height reaches it: {low:.3f} to {high:.3f} m below"
    return (
        f"a trocar {1e3 * near:.0f} to {1e3 * far:.0f} mm beside "
        f"[{x:.3f}, {y:.3f}] on the wall would do"
    )
