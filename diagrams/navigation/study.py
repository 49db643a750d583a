"""The navigation as a study: what is logged, measured, plotted and shown."""

from typing import Any

import numpy as np
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.analysis import SimulatorConfig

from diagrams.common.replay import draw_trail
from diagrams.common.study import Study, View
from diagrams.navigation.diagram import floor, make_navigation_diagram
from diagrams.navigation.live import LIVE
from diagrams.navigation.metrics import measure
from diagrams.navigation.perceived import decorate_perception
from diagrams.navigation.plots import plots, state_names
from diagrams.navigation.scenario import NavigationScenario, companions
from plants.crowd.signals import OBSTACLES
from plants.turtlebot.lidar import SCAN
from plants.turtlebot.signals import Command, RobotState
from systems.perception.signals import MOVING, Sureness
from systems.switching.signals import Mode, PlanarVelocity

SIGNALS = {
    "robot.state": RobotState,
    "obstacles.rows": OBSTACLES,
    "planner.v_R": PlanarVelocity,
    "planner.mode": Mode,
    "control.command": Command,
}
SENSED = {
    "lidar.scan": SCAN,
    "mapping.place": RobotState,
    "mapping.sureness": Sureness,
    "tracking.moving": MOVING,
}
"""What is logged beside, where the robot sees for itself."""
LAMPS = (
    (0.20, 0.66, 0.36, 1.0),  # attractive
    (0.95, 0.75, 0.15, 1.0),  # bypass
    (0.84, 0.25, 0.20, 1.0),  # group
    (0.20, 0.60, 0.90, 1.0),  # leave
    (0.60, 0.30, 0.75, 1.0),  # yield
    (0.10, 0.10, 0.10, 1.0),  # unreachable
    (0.98, 0.45, 0.65, 1.0),  # evade
)
"""Colours of the lamp above the robot, by the planner's state."""


def light(meshcat: Any, floor: list[float]) -> None:
    """Even light, and the whole floor in view."""
    for name, intensity in (
        ("AmbientLight", 1.6),
        ("FillLight", 0.7),
        ("PointLightNegativeX", 0.0),
        ("PointLightPositiveX", 0.0),
        ("SpotLight", 0.0),
    ):
        meshcat.SetProperty(f"/Lights/{name}/<object>", "intensity", intensity)
    low_x, low_y, high_x, high_y = floor
    x, y = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    size = max(high_x - low_x, 1.3 * (high_y - low_y))
    meshcat.SetCameraPose([x, y - 0.36 * size, 0.48 * size], [x, y, 0.0])


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """The robot's trail, and a lamp above it in the colour of the state."""
    light(meshcat, floor(run.scenario))
    if run.scenario.senses == "lidar":
        decorate_perception(meshcat, animation, run)
    time = run.signals["time"]
    robot = run.robot.state
    trail = np.column_stack([robot.x, robot.y, np.full(len(time), 0.02)])
    draw_trail(meshcat, animation, "trail", time, trail, (0.12, 0.37, 0.85, 1.0), 80)
    mode = np.round(run.planner.mode.state).astype(int)
    for number, name in enumerate(state_names(run.scenario.planner)):
        lamp = f"lamp/{name.replace(' ', '_')}"
        meshcat.SetObject(lamp, Sphere(0.075), Rgba(*LAMPS[number]))
        shown: bool | None = None
        for t, x, y, current in zip(time, robot.x, robot.y, mode, strict=True):
            frame = animation.frame(t)
            animation.SetTransform(frame, lamp, RigidTransform([x, y, 0.38]))
            if shown != (current == number):
                shown = bool(current == number)
                animation.SetProperty(frame, lamp, "visible", shown)


STUDY = Study(
    name="navigation",
    scenario=NavigationScenario,
    make_diagram=lambda case: make_navigation_diagram(case.scenario),
    measure=measure,
    signals=lambda scenario: SIGNALS | (SENSED if scenario.senses == "lidar" else {}),
    log_period=0.05,
    plots=plots,
    decorate=decorate,
    controller="planner",
    companions=companions,
    required=("system", "duration", "start", "goal"),
    frame_rate=20.0,  # as often as the planner: other instants would cost steps
    view=View(camera=(4.0, -7.5, 7.0), target=(4.5, 0.0, 0.0)),
    # No MultibodyPlant here: CENIC needs one. Fixed steps, on the planner's clock.
    integrator=lambda scenario: SimulatorConfig(
        integration_scheme="runge_kutta3",
        max_step_size=0.05,
        use_error_control=False,
    ),
    live=LIVE,
)
