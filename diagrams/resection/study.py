"""The resection as a study: what is logged, measured, plotted and shown."""

from pathlib import Path
from time import time
from typing import Any

from diagrams.common.study import Study, View, cenic
from diagrams.resection.diagram import make_resection_diagram
from diagrams.resection.metrics import measure
from diagrams.resection.operation import (
    LOG_PERIOD,
    Operation,
    length,
    outline,
    prepare,
)
from diagrams.resection.plots import plots
from diagrams.resection.replay import decorate
from diagrams.resection.scenario import ResectionScenario, check
from plants.tissue.execution import save_execution
from systems.common.archive import beside

XYZ = ("x", "y", "z")
TOOL = (*XYZ, "n_x", "n_y", "n_z")
SIGNALS = {
    "tip.reference": TOOL,
    "plan.progress": ("index",),
    "snake.tool": TOOL,
    "snake.posture": ("s", "alpha1", "beta1", "alpha2", "beta2", "alpha3", "beta3"),
    "ik.status": ("code",),
    "drums.limited": ("code",),
    "tissue.index": ("index",),
    "tissue.removed": ("tumour", "healthy"),
    "tissue.touched": ("hits", "critical_distance"),
    "tissue.way": ("length",),
    "watch.alarm": ("time", "module"),
}


SAVE_EVERY = 5.0
"""Least wall time in s between two savings of what has been carried out."""


def keep(case: Operation, station: Any, context: Any, ended: bool) -> None:
    """Saves what has been carried out, beside the session's file if it has one."""
    if not case.scenario.session:
        return
    file = beside(Path(case.scenario.session), "executed")
    if not ended and file.is_file() and time() - file.stat().st_mtime < SAVE_EVERY:
        return
    player = station.GetSubsystemByName("procedure_player")
    carver = station.GetSubsystemByName("tissue_carver")
    posture = player.GetOutputPort("progress").Eval(
        player.GetMyContextFromRoot(context)
    )
    done = carver.execution(carver.GetMyContextFromRoot(context), int(posture[0]))
    save_execution(file, done, case.session.postures)


STUDY = Study(
    name="resection",
    scenario=ResectionScenario,
    make_diagram=make_resection_diagram,
    check=check,
    measure=measure,
    signals=SIGNALS,
    log_period=LOG_PERIOD,
    plots=plots,
    decorate=decorate,
    controller="resection_ik",
    integrator=lambda scenario: cenic(scenario.period),  # one step a command
    view=View(camera=(0.055, -0.075, 0.035), target=(0.0, 0.0, 0.014)),
    frame_rate=10.0,
    length=length,
    keep=keep,
    prepare=prepare,
    outline=outline,
    replay_length=45.0,
)
"""The resection of a tumour."""
