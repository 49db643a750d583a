"""The scenario of a wrist study: a scripted task through a wall that moves."""

from dataclasses import dataclass, field, replace

from diagrams.bedside.wrist import WristSettings, check_wrist
from diagrams.common.scenario import Scenario, ScenarioError
from plants.abdomen.abdomen import AbdomenParams
from plants.arm.arm import ArmParams
from plants.instruments.instrument import InstrumentParams
from systems.motion.joint_commands import JointCommandsParams
from systems.passive_wrist.arc_navigation import ArcParams
from systems.passive_wrist.wrist_law import MODES


@dataclass
class WristTool:
    """Where the robot's tool is at the start, in W [m].

    Attributes:
        p_WG: Its true fulcrum, the wall at rest.
        p_WP: Its tip.
    """

    p_WG: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    p_WP: list[float] = field(default_factory=lambda: [0.0, 0.0, -0.18])


@dataclass
class WristScenario(Scenario, WristSettings):
    """Passive wrist emulation (section 3 of the paper) under a scripted task.

    Attributes:
        measure_from: Force and error figures start here [s].
        compare: Modes that are run as well and drawn beside it.
        event: Time of the wall's jump, for `time_to_2N` and `time_to_02N`; negative
            if there is none [s].
    """

    measure_from: float = 0.0
    event: float = -1.0
    compare: list[str] = field(default_factory=list)
    robot: WristTool = field(default_factory=WristTool)
    arcs: ArcParams = field(default_factory=ArcParams)
    joints: JointCommandsParams = field(default_factory=JointCommandsParams)
    arm: ArmParams = field(default_factory=ArmParams)
    instrument: InstrumentParams = field(default_factory=InstrumentParams)
    abdomen: AbdomenParams = field(default_factory=AbdomenParams)


UNLIMITED = 1e3
"""Force limit in N of the comparisons that cannot relax the wall."""


def companions(scenario: WristScenario) -> dict[str, WristScenario]:
    """The scenario in the other modes that it names, without a force limit.

    A wrist that cannot relax the wall would stand still for ever.
    """
    wrist = replace(scenario.passive_wrist, force_limit=UNLIMITED)
    return {
        mode: replace(scenario, wrist=mode, compare=[], passive_wrist=wrist)
        for mode in scenario.compare
    }


def check(scenario: WristScenario) -> None:
    """Raises ValueError for a scenario that cannot run."""
    for part in vars(scenario).values():
        if hasattr(part, "check"):
            part.check()
    check_wrist(scenario)
    for mode in scenario.compare:
        if mode not in MODES:
            raise ScenarioError(f"compare={mode!r}: choose from {', '.join(MODES)}")
