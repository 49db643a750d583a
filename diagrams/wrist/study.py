"""The passive wrist as a study: what is logged, measured, plotted and shown."""

from typing import Any

from diagrams.bedside.bedside import stiffen
from diagrams.bedside.wrist import wrist_signals
from diagrams.bedside.wrist_metrics import wrist_figures
from diagrams.bedside.wrist_replay import decorate_wrist
from diagrams.common.study import Study, View
from diagrams.wrist.diagram import make_wrist_diagram
from diagrams.wrist.live import LIVE
from diagrams.wrist.plots import plots
from diagrams.wrist.scenario import WristScenario, companions
from plants.abdomen.wall_force import FulcrumError
from systems.common.signals import Force, RobotTool
from systems.motion.joint_commands import Status

SIGNALS = {
    "robot.tool": RobotTool,
    "joints.status": Status,
    "wall.force": Force,
    "wall.fulcrum_error": FulcrumError,
}


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run."""
    return wrist_figures(run, run.scenario.measure_from, run.scenario.event)


STUDY = Study(
    name="wrist",
    scenario=WristScenario,
    make_diagram=lambda case: make_wrist_diagram(case.scenario),
    measure=measure,
    signals=lambda scenario: SIGNALS | wrist_signals(scenario),
    log_period=1.0 / 120.0,
    plots=plots,
    decorate=decorate_wrist,
    controller="passive_wrist",
    adjust=stiffen,
    companions=companions,
    required=("system", "duration", "wrist", "robot.p_WG", "robot.p_WP"),
    view=View(camera=(0.3, -0.42, 0.14), target=(0.0, 0.0, 0.0)),
    live=LIVE,
)
