"""The entry in passes of growing bend: a pilot makes the room in which others bend."""

import math

import numpy as np

from plants.snake.last_module import meridian
from plants.snake.parameters import SnakeParams
from plants.tissue.labels import TUMOUR
from systems.resection.planning.procedure import ENTRY, Procedure
from systems.resection.planning.session import Session

PILOT = math.radians(8.0)
"""Bend of the pilot in rad."""


def radius_of(bend: float, params: SnakeParams) -> float:
    """Radius in m of what the tool removes at a bend of the last module in rad."""
    return float(meridian(bend, params)[0]) + params.tool_radius


def entry_pass(session: Session, bend: float, pitch: float, name: str) -> Procedure:
    """A clipped entry to the far end of the tumour.

    Args:
        session: The session.
        bend: Of the last module, in rad.
        pitch: Of its poses, in m.
        name: What it is called.
    """
    volume, params = session.volume, session.params
    X_EW = np.linalg.inv(session.X_WE)
    tumour = volume.points(volume.labels == TUMOUR)
    deepest = float((tumour @ X_EW[2, :3] + X_EW[2, 3]).max())
    length = deepest - volume.depth + params.tool_radius
    travel = params.travel[1] - float(session.home[0])
    return Procedure(
        kind=ENTRY,
        length=min(max(length, pitch), travel),
        radius=radius_of(bend, params),
        clipped=True,
        pitch=pitch,
        name=name,
    )
