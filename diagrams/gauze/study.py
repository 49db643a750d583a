"""The gauze delivery as a study: what is logged, measured, plotted and shown."""

from typing import Any

import numpy as np

from diagrams.bedside.bedside import stiffen
from diagrams.bedside.wrist import wrist_signals
from diagrams.bedside.wrist_replay import decorate_wrist
from diagrams.common.replay import draw_arrow, draw_trail
from diagrams.common.study import Study, View
from diagrams.gauze import film
from diagrams.gauze.contact import contact_signals
from diagrams.gauze.diagram import make_gauze_diagram
from diagrams.gauze.ending import ending
from diagrams.gauze.live import LIVE
from diagrams.gauze.metrics import measure
from diagrams.gauze.organs import organ_signals
from diagrams.gauze.plots import plots
from diagrams.gauze.scenario import GauzeScenario, companions
from diagrams.gauze.tools import OBSTACLE, gather, hands, in_the_way, logged
from plants.abdomen.wall_force import FulcrumError
from plants.arm.signals import Posture
from plants.instruments.clearance import Gap, column
from systems.auto_guidance.fuzzy_arbiter import Weights
from systems.bypass.tool_bypass import Way
from systems.common.signal import Many
from systems.common.signals import (
    Alignment,
    ClearanceStatus,
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
from systems.motion.sight import Sight
from systems.motion.tool_navigation import StopCode

SIGNALS = {
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
    "clearance": Gap,
    "wall.force": Force,
    "wall.fulcrum_error": FulcrumError,
}


def signals(scenario: GauzeScenario) -> dict[str, Any]:
    """What is logged: without the bypass there is no way, without force no wrist."""
    ports: dict[str, Any] = {"robot.tool": RobotTool}
    tools = hands(scenario.tools, scenario.seed)
    ports |= {f"{name}.shaft": Shaft for name in tools}
    obstacles = [name for name, tool in tools.items() if tool.role == OBSTACLE]
    ports |= {f"{name}.tip_velocity": Velocity for name in obstacles}
    ports |= {f"{name}.estimate": Estimate for name in tools}
    ports |= {f"{scenario.camera.name}.view_cone": ViewCone}
    near = in_the_way(scenario.tools)
    columns = tuple(column(name, role, near) for name, role in near)
    ports |= {
        port: Many(Gap, columns) if port == "clearance" else kind
        for port, kind in SIGNALS.items()
    }
    ports |= wrist_signals(scenario) if scenario.emulated else {}
    if scenario.registration.active:
        ports["tracker.alignment"] = Alignment
    ports |= organ_signals(scenario) | contact_signals(scenario)
    if scenario.camera_planner.active:
        ports["camera.sight"] = Sight
    if scenario.behaviour != "bypass":
        del ports["planner.way"]
    return ports


METRES_PER_NEWTON = 0.02
"""Scale of the replay's force arrow."""


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """Trails of both tips, and the wall's force as an arrow at the fulcrum."""
    time = run.signals["time"]
    trails = {"robot": (run.robot.tool.tip, (0.12, 0.37, 0.85, 1.0))}
    for tool in run.scenario.obstacles:
        trails[tool.name] = (logged(run, tool).shaft.tip, (0.85, 0.2, 0.15, 1.0))
    for name, (way, rgba) in trails.items():
        draw_trail(meshcat, animation, f"trails/{name}", time, way, rgba)
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
    gather=gather,
    measure=measure,
    signals=signals,
    log_period=1.0 / 30.0,
    plots=plots,
    decorate=decorate,
    controller="tool_navigation",
    adjust=stiffen,
    ending=ending,
    companions=companions,
    can_film=film.refuse_without_egl,
    film=film.save_film,
    live=LIVE,
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
