"""The scenario of a wrist study: a scripted task through a wall that moves."""

from dataclasses import dataclass, replace

from diagrams.bedside.bedside import ToolAtStart
from diagrams.bedside.wrist import TipSettings, WristSettings
from diagrams.common.scenario import Scenario
from plants.abdomen.abdomen import AbdomenParams
from plants.arm.arm import ArmParams
from plants.instruments.instrument import InstrumentParams
from systems.common.parameter import parameter, part
from systems.motion.joint_commands import JointCommandsParams
from systems.passive_wrist.arc_navigation import ArcParams
from systems.passive_wrist.hand_navigation import HandNavigationParams
from systems.passive_wrist.wrist_law import MODES


@dataclass
class WristScenario(Scenario, WristSettings, TipSettings):
    """Passive wrist emulation (section 3 of the paper) under a scripted task."""

    measure_from: float = parameter(
        0.0, "force and error figures start here", "s", least=0.0, most=1e5
    )
    event: float = parameter(
        -1.0, "time of the wall's jump, negative for none", "s", least=-1.0, most=1e5
    )
    compare: list[str] = parameter(
        [], "modes that are run as well and drawn beside it", choices=MODES, shape=(-1,)
    )
    guided: str | None = parameter(
        None, "tape `t,x,y,z` of where a hand led the tip; '': live", file=True
    )
    hand: HandNavigationParams = part(HandNavigationParams)
    robot: ToolAtStart = part(ToolAtStart)
    arcs: ArcParams = part(ArcParams)
    joints: JointCommandsParams = part(JointCommandsParams)
    arm: ArmParams = part(ArmParams)
    instrument: InstrumentParams = part(InstrumentParams)
    abdomen: AbdomenParams = part(AbdomenParams)


UNLIMITED = 50.0
"""Force limit in N of the comparisons that cannot relax the wall: the highest."""


def companions(scenario: WristScenario) -> dict[str, WristScenario]:
    """The scenario in the other modes that it names, with the highest force limit.

    A wrist that cannot relax the wall would stand still for ever.
    """
    wrist = replace(scenario.passive_wrist, force_limit=UNLIMITED)
    return {
        mode: replace(scenario, wrist=mode, compare=[], passive_wrist=wrist)
        for mode in scenario.compare
    }
