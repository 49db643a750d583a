"""A resection live: it is watched, stopped, and its wires fail."""

from typing import Any

from diagrams.common.live import Figure, Live, Switch
from diagrams.snake.live import words
from plants.snake.signals import ToolPose
from plants.tissue.tissue_carver import Removed, Touched


def cut(session: Any) -> float:
    """Share of the tumour that is gone."""
    whole: float = session.case.session.volume.tumour_volume
    return float(session.read("tissue.removed", Removed).tumour) / whole


def hits(session: Any) -> float:
    """Checks that found the body in tissue."""
    return float(session.read("tissue.touched", Touched).hits)


CUT = Figure("tumour cut [%]", cut, 0.0, 100.0, 0.1, 100.0)

LIVE = Live(
    switches=lambda scenario: [Switch("tension not read", "tension_nan", 0.1)],
    figures=lambda scenario: [
        CUT,
        Figure("body hits", hits, 0.0, 1000.0, 1.0, 1.0),
    ],
    words=words,
    moving=lambda session: session.read("snake.tool", ToolPose).p,
    streamed=lambda session: {"Snake": tuple(session.read("snake.tool", ToolPose))},
    frame=0.02,  # the drums' period
)
