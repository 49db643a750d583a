"""The moving snake as a study: what is logged, measured, plotted and shown."""

from typing import Any

import numpy as np
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.analysis import SimulatorConfig

from diagrams.common.replay import draw_trail
from diagrams.common.study import Study, View, cenic
from diagrams.snake.diagram import make_snake_diagram
from diagrams.snake.live import LIVE
from diagrams.snake.metrics import break_time, measure
from diagrams.snake.plots import plots, turns_in
from diagrams.snake.robot import STATICS_SIGNALS, is_free
from diagrams.snake.scenario import SnakeScenario
from diagrams.snake.sensing import SIGNALS_OF, chosen
from diagrams.snake.wire_replay import animate_wires
from plants.snake.signals import Drums, Tensions, ToolPose
from systems.resection.wires.resection_ik import IkStatus
from systems.resection.wires.snake_location import Bends, CouplerError
from systems.resection.wires.wire_drums import Limited
from systems.resection.wires.wire_forward_actuation import Residual
from systems.resection.wires.wire_watch import Alarm

SIGNALS = {
    "tip.reference": ToolPose,
    "snake.tool": ToolPose,
    "snake.posture": Bends,
    "ik.status": IkStatus,
    "drums.lengths": Drums,
    "drums.limited": Limited,
    "wires.tension": Tensions,
    "watch.alarm": Alarm,
}
PAPERS_SIGNALS = {"snake.coupler_error": CouplerError, "wires.residual": Residual}
FRAME_RATE = 10.0
"""Meshcat interpolates between frames, and 108 pieces of wire are drawn in each."""
LOG_PERIOD = 0.02


def integrator(scenario: SnakeScenario) -> SimulatorConfig:
    """CENIC with one step a command; the elastic wires have a discrete plant."""
    if scenario.wires == "elastic":
        return SimulatorConfig()
    return cenic(scenario.period)


def signals(scenario: SnakeScenario) -> dict[str, Any]:
    """What is logged of a scenario."""
    known = SIGNALS | (STATICS_SIGNALS if is_free(scenario) else PAPERS_SIGNALS)
    for key in chosen(scenario):
        known = known | SIGNALS_OF[key]
    return known


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """Wires, the tip's trail, and the poses or the circle it is to take."""
    time = run.signals["time"]
    every = round(1.0 / (FRAME_RATE * LOG_PERIOD))
    snapped = break_time(run.scenario)
    broken = {item.wire: item.time for item in run.scenario.elastic.breaks}
    if snapped is None or snapped > time[-1]:
        broken = {}
    animate_wires(
        meshcat,
        animation,
        "wires",
        time[::every],
        turns_in(run)[::every],
        run.snake.posture.q[::every, 0],
        run.scenario.snake,
        broken,
    )
    blue = (0.12, 0.37, 0.85, 1.0)
    draw_trail(meshcat, animation, "trail", time, run.snake.tool.p, blue)
    green = Rgba(0.16, 0.56, 0.31, 1.0)
    reference = run.tip.reference.p
    if run.scenario.tip.poses:
        for i, point in enumerate(np.unique(reference, axis=0)):
            meshcat.SetObject(f"poses/{i}", Sphere(0.9e-3), green)
            meshcat.SetTransform(f"poses/{i}", RigidTransform(point))
    else:
        turn = time <= run.scenario.tip.circle.ramp + run.scenario.tip.circle.period
        meshcat.SetLine("circle", reference[turn].T, 2.0, green)


STUDY = Study(
    name="snake",
    scenario=SnakeScenario,
    make_diagram=lambda case: make_snake_diagram(case.scenario),
    measure=measure,
    signals=signals,
    log_period=LOG_PERIOD,
    plots=plots,
    decorate=decorate,
    controller="resection_ik",
    integrator=integrator,
    view=View(camera=(0.060, -0.068, 0.048), target=(0.0, 0.0, 0.025)),
    frame_rate=FRAME_RATE,
    live=LIVE,
)
