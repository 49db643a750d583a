"""The gauze delivery as a study: what is logged, measured, plotted and shown."""

from typing import Any

import numpy as np

from diagrams.bedside.bedside import stiffen
from diagrams.bedside.wrist import WRIST_SIGNALS
from diagrams.bedside.wrist_replay import decorate_wrist
from diagrams.common.replay import draw_arrow, draw_trail
from diagrams.common.study import Study, View
from diagrams.gauze.diagram import make_gauze_diagram
from diagrams.gauze.metrics import measure
from diagrams.gauze.plots import plots
from diagrams.gauze.scenario import GauzeScenario, check, companions
from plants.abdomen.wall_force import FulcrumError
from plants.arm.signals import Posture
from plants.instruments.clearance import Clearances
from systems.auto_guidance.fuzzy_arbiter import Weights
from systems.bypass.clearance_constraint import ClearanceStatus
from systems.bypass.tool_bypass import Way
from systems.common.signals import (
    Estimate,
    Force,
    Guide,
    RobotTool,
    Shaft,
    ToolMotion,
    Velocity,
    ViewCone,
)
from systems.motion.joint_commands import Status
from systems.motion.tool_navigation import StopCode

SIGNALS = {
    "robot.tool": RobotTool,
    "target.shaft": Shaft,
    "obstacle.shaft": Shaft,
    "obstacle.tip_velocity": Velocity,
    "target.estimate": Estimate,
    "obstacle.estimate": Estimate,
    "camera.view_cone": ViewCone,
    "planner.guide": Guide,
    "planner.v1": Velocity,
    "planner.v2": Velocity,
    "planner.v3": Velocity,
    "planner.weights": Weights,
    "planner.v_R": Velocity,
    "planner.v_safe": Velocity,
    "planner.clearance": ClearanceStatus,
    "planner.way": Way,
    "navigation.tool": ToolMotion,
    "navigation.stop": StopCode,
    "joints.posture": Posture,
    "joints.status": Status,
    "clearance": Clearances,
    "wall.force": Force,
    "wall.fulcrum_error": FulcrumError,
}


def signals(scenario: GauzeScenario) -> dict[str, Any]:
    """What is logged: without the bypass there is no way, without force no wrist."""
    logged = SIGNALS | (WRIST_SIGNALS if scenario.emulated else {})
    if scenario.behaviour != "bypass":
        del logged["planner.way"]
    return logged


METRES_PER_NEWTON = 0.02
"""Scale of the replay's force arrow."""


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """Trails of both tips, and the wall's force as an arrow at the fulcrum."""
    time = run.signals["time"]
    for name, signal, rgba in (
        ("robot", run.robot.tool.tip, (0.12, 0.37, 0.85, 1.0)),
        ("obstacle", run.obstacle.shaft.tip, (0.85, 0.2, 0.15, 1.0)),
    ):
        draw_trail(meshcat, animation, f"trails/{name}", time, signal, rgba)
    if run.scenario.emulated:
        decorate_wrist(meshcat, animation, run)
        return
    force = run.wall.force.f * METRES_PER_NEWTON
    origins = np.broadcast_to(run.scenario.robot.p_WG, force.shape)
    draw_arrow(
        meshcat, animation, "wall_force", time, origins, force, (0.95, 0.6, 0.1, 1.0)
    )


STUDY = Study(
    name="gauze",
    scenario=GauzeScenario,
    make_diagram=lambda case: make_gauze_diagram(case.scenario),
    check=check,
    measure=measure,
    signals=signals,
    log_period=1.0 / 30.0,
    plots=plots,
    decorate=decorate,
    controller="tool_navigation",
    adjust=stiffen,
    companions=companions,
    required=(
        "system",
        "duration",
        "robot.p_WG",
        "robot.p_WP",
        "target.p_WG",
        "obstacle.p_WG",
    ),
    view=View(camera=(0.40, -0.50, 0.10), target=(-0.01, 0.0, -0.02)),
)
