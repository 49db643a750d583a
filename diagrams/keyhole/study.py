"""The operation through one trocar as a study: logged, measured, plotted and shown."""

from typing import Any

from pydrake.systems.analysis import SimulatorConfig

from diagrams.bedside.bedside import stiffen
from diagrams.bedside.wrist import WRIST_SIGNALS
from diagrams.common.study import Study, View, cenic
from diagrams.gauze.tools import gather, in_the_way
from diagrams.keyhole.diagram import make_keyhole_diagram
from diagrams.keyhole.live import LIVE
from diagrams.keyhole.metrics import measure
from diagrams.keyhole.operation import LOG_PERIOD, length, outline, prepare
from diagrams.keyhole.plots import plots
from diagrams.keyhole.replay import decorate
from diagrams.keyhole.scenario import KeyholeScenario
from plants.abdomen.wall_force import FulcrumError
from plants.instruments.clearance import Gap, column
from plants.snake.signals import ToolPose
from plants.tissue.tissue_carver import Moves, Removed, Touched, Way
from systems.common.signal import Many
from systems.common.signals import Force, MovingPoint, RobotTool, Shaft
from systems.keyhole.signals import BodyDeviation, Phase, SnakeStatus, TubeStatus
from systems.motion.joint_commands import Status
from systems.motion.tool_navigation import StopCode
from systems.passive_wrist.sensor_zero import SensorZero
from systems.resection.wires.resection_ik import IkStatus
from systems.resection.wires.snake_location import Bends, CouplerError
from systems.resection.wires.wire_drums import Limited
from systems.resection.wires.wire_watch import Alarm
from systems.sensing.organ_estimator import OrganMotion

SIGNALS = WRIST_SIGNALS | {
    "robot.tool": RobotTool,
    "joints.status": Status,
    "wrist.zero": SensorZero,
    "wall.force": Force,
    "wall.fulcrum_error": FulcrumError,
    "operation.phase": Phase,
    "operation.tube": TubeStatus,
    "operation.snake": SnakeStatus,
    "organ.true": MovingPoint,
    "organ.estimate": OrganMotion,
    "tip.reference": ToolPose,
    "snake.deviation": BodyDeviation,
    "snake.tool": ToolPose,
    "snake.posture": Bends,
    "snake.coupler_error": CouplerError,
    "ik.status": IkStatus,
    "drums.limited": Limited,
    "watch.alarm": Alarm,
}
TISSUE = {
    "tissue.index": Moves,
    "tissue.removed": Removed,
    "tissue.touched": Touched,
    "tissue.way": Way,
}


def signals(scenario: KeyholeScenario) -> dict[str, Any]:
    """What is logged: tissue only where there is some."""
    found: dict[str, Any] = SIGNALS | (TISSUE if scenario.task == "resect" else {})
    if scenario.others:
        near = in_the_way(scenario.theatre.tools)
        columns = tuple(column(name, role, near) for name, role in near)
        found |= {"clearance": Many(Gap, columns), "navigation.stop": StopCode}
        found |= {f"{tool.name}.shaft": Shaft for tool in scenario.theatre.obstacles}
    return found


def gather_tools(tree: dict[str, Any]) -> None:
    """Brings the theatre's tools into their list, in place."""
    theatre = tree.get("theatre", {})
    if isinstance(theatre, dict):
        gather(theatre)
        tree["theatre"] = theatre


def integrator(scenario: KeyholeScenario) -> SimulatorConfig:
    """CENIC with one implicit step a control instant: its commands come so often."""
    config = cenic(scenario.joints.period)
    config.use_error_control = False
    config.accuracy = 1e-4  # of its solver: at 1e-2 the wrist hears it
    return config


STUDY = Study(
    name="keyhole",
    scenario=KeyholeScenario,
    make_diagram=make_keyhole_diagram,
    measure=measure,
    signals=signals,
    log_period=LOG_PERIOD,
    plots=plots,
    decorate=decorate,
    controller="passive_wrist",
    adjust=stiffen,
    integrator=integrator,
    required=("system", "duration", "task", "robot.p_WG", "robot.p_WP"),
    view=View(camera=(0.36, -0.52, 0.12), target=(-0.04, 0.0, -0.02)),
    close_up=View(camera=(0.055, -0.10, -0.085), target=(0.0, 0.0, -0.112)),
    gather=gather_tools,
    length=length,
    prepare=prepare,
    outline=outline,
    replay_length=60.0,
    live=LIVE,
)
"""The operation through one trocar."""
