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

XYZ = ("x", "y", "z")
SHAFT = ("tip_x", "tip_y", "tip_z", "u_x", "u_y", "u_z")
ESTIMATE = (
    *(f"{part}_{axis}" for part in ("p", "v", "a", "fulcrum") for axis in XYZ),
    *("sigma_p", "sigma_v", "sigma_a", "known", "age"),
)
SIGNALS: dict[str, tuple[str, ...]] = {
    "robot.tool": (*(f"fulcrum_{axis}" for axis in XYZ), "tip_x", "tip_y", "tip_z"),
    "target.shaft": SHAFT,
    "obstacle.shaft": SHAFT,
    "obstacle.tip_velocity": XYZ,
    "target.estimate": ESTIMATE,
    "obstacle.estimate": ESTIMATE,
    "camera.view_cone": (*(f"apex_{a}" for a in XYZ), "u_x", "u_y", "u_z", "half"),
    "planner.guide": (
        *(f"M_R_{axis}" for axis in XYZ),
        *(f"M_O_{axis}" for axis in XYZ),
        *("rho", "s", "l_over_L"),
        *(f"M_Rf_{axis}" for axis in XYZ),
    ),
    "planner.v1": XYZ,
    "planner.v2": XYZ,
    "planner.v3": XYZ,
    "planner.weights": ("c1", "c2", "c3"),
    "planner.v_R": XYZ,
    "planner.v_safe": XYZ,
    "planner.clearance": ("room", "near", "condition", "dodge", "change", "missed"),
    "planner.way": ("way", "waiting", "aim_x", "aim_y", "aim_z", "switches"),
    "navigation.tool": (
        *SHAFT,
        *(f"v_{axis}" for axis in XYZ),
        *(f"du_{axis}" for axis in XYZ),
        "time",
    ),
    "navigation.stop": ("code",),
    "joints.posture": tuple(f"q{i}" for i in range(1, 8)),
    "joints.status": ("code",),
    "clearance": ("obstacle", "target", "camera"),
    "wall.force": XYZ,
    "wall.fulcrum_error": ("distance",),
    **WRIST_SIGNALS,
}
METRES_PER_NEWTON = 0.02
"""Scale of the replay's force arrow."""


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """Trails of both tips, and the wall's force as an arrow at the fulcrum."""
    time = run.signals["time"]
    for name, signal, rgba in (
        ("robot", run.matrix("robot.tool")[:, 3:], (0.12, 0.37, 0.85, 1.0)),
        ("obstacle", run.matrix("obstacle.shaft")[:, :3], (0.85, 0.2, 0.15, 1.0)),
    ):
        draw_trail(meshcat, animation, f"trails/{name}", time, signal, rgba)
    if run.scenario.emulated:
        decorate_wrist(meshcat, animation, run)
        return
    force = run.matrix("wall.force") * METRES_PER_NEWTON
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
    signals=SIGNALS,
    optional=frozenset({*WRIST_SIGNALS, "planner.way"}),
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
