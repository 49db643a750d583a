"""The resection as a study: what is logged, measured, plotted and shown."""

from pathlib import Path
from time import time
from typing import Any

from diagrams.common.study import Study, View, cenic
from diagrams.resection.diagram import make_resection_diagram
from diagrams.resection.live import LIVE
from diagrams.resection.metrics import measure
from diagrams.resection.online import is_over, outline, prepare
from diagrams.resection.operation import LOG_PERIOD, Operation, length
from diagrams.resection.plots import plots
from diagrams.resection.replay import decorate
from diagrams.resection.scenario import ResectionScenario
from diagrams.snake.robot import STATICS_SIGNALS, is_free
from plants.snake.signals import ToolPose
from plants.tissue.execution import save_execution
from plants.tissue.tissue_carver import Moves, Removed, Touched, Way
from systems.common.archive import beside
from systems.resection.wires.online_player import Taken, Waiting
from systems.resection.wires.procedure_player import Progress
from systems.resection.wires.resection_ik import IkStatus
from systems.resection.wires.snake_location import Bends
from systems.resection.wires.wire_drums import Limited
from systems.resection.wires.wire_watch import Alarm

SIGNALS = {
    "tip.reference": ToolPose,
    "plan.progress": Progress,
    "snake.tool": ToolPose,
    "snake.posture": Bends,
    "ik.status": IkStatus,
    "drums.limited": Limited,
    "tissue.index": Moves,
    "tissue.removed": Removed,
    "tissue.touched": Touched,
    "tissue.way": Way,
    "watch.alarm": Alarm,
}

ONLINE_SIGNALS = {"plan.taken": Taken, "plan.waiting": Waiting}


def signals(scenario: ResectionScenario) -> dict[str, Any]:
    """What is logged of a scenario."""
    online = {} if scenario.choices is None else ONLINE_SIGNALS
    return SIGNALS | online | (STATICS_SIGNALS if is_free(scenario) else {})


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
    (posture,) = player.GetOutputPort("progress").Eval(
        player.GetMyContextFromRoot(context)
    )
    done = carver.execution(carver.GetMyContextFromRoot(context), int(posture))
    save_execution(file, done, case.session.postures)


STUDY = Study(
    name="resection",
    scenario=ResectionScenario,
    make_diagram=make_resection_diagram,
    measure=measure,
    signals=signals,
    log_period=LOG_PERIOD,
    plots=plots,
    decorate=decorate,
    controller="resection_ik",
    integrator=lambda scenario: cenic(scenario.period),  # one step a command
    view=View(camera=(0.055, -0.075, 0.035), target=(0.0, 0.0, 0.014)),
    frame_rate=10.0,
    length=length,
    keep=keep,
    ending=lambda case, station: lambda context: is_over(case, station, context),
    prepare=prepare,
    outline=outline,
    replay_length=45.0,
    live=LIVE,
)
"""The resection of a tumour."""
