"""What is drawn into an operation's replay: the organ, the tool's trail, the forces."""

from typing import Any

import numpy as np
from pydrake.geometry import Ellipsoid, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.bedside.wrist_replay import decorate_wrist
from diagrams.common.replay import draw_trail
from diagrams.keyhole.metrics import working
from diagrams.resection.replay import draw_tissue

ORGAN = Rgba(0.62, 0.27, 0.22, 0.25)
PATH = "organ"
_HALF_AXES = (0.055, 0.045, 0.028)
"""Of the organ that is drawn, in m; the entry lies on its top."""


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """The organ that breathes, its tumour, what the tool drew in it; wall and force."""
    decorate_wrist(meshcat, animation, run)
    every = max(1, round(run.replay_speed))
    time = run.signals["time"][::every] / run.replay_speed
    R_WE = RotationMatrix(run.scenario.R_WE)
    for t, p in zip(time, run.organ.true.p[::every], strict=True):
        animation.SetTransform(animation.frame(t), PATH, RigidTransform(R_WE, p))
    meshcat.SetObject(f"{PATH}/body", Ellipsoid(*_HALF_AXES), ORGAN)
    below = RigidTransform([0.0, 0.0, _HALF_AXES[2]])
    meshcat.SetTransform(f"{PATH}/body", below)
    at_work = working(run)[::every]
    tool, reference = run.snake.tool.p[::every], run.tip.reference.p[::every]
    if run.case.resection is None:
        if at_work.any():
            line = reference[at_work][: round(8.0 / (time[1] - time[0]))]
            meshcat.SetLine(f"{PATH}/circle", line.T, 3.0, Rgba(0.2, 0.7, 0.35, 1.0))
    else:
        draw_tissue(meshcat, animation, run, path=f"{PATH}/")
    if at_work.sum() > 1:
        blue = (0.12, 0.37, 0.85, 1.0)
        draw_trail(
            meshcat, animation, f"{PATH}/trail", time[at_work], tool[at_work], blue
        )
    # Where a scenario puts the organ, whatever the recording begins with.
    meshcat.SetTransform(PATH, RigidTransform(R_WE, np.array(run.scenario.entry.p_WE)))
