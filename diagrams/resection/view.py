"""A session in Meshcat: what remains, and where something is feasible now."""

from typing import Any

import numpy as np
from pydrake.geometry import Rgba
from scipy.spatial import cKDTree

from diagrams.resection.replay import TISSUE, coarse, shown_spacing
from diagrams.snake.sliders import show_snake
from plants.tissue.labels import CAP, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from systems.resection.planning.feasibility_map import FeasibilityMap
from systems.resection.planning.session import Session

FEASIBLE = np.array([0.15, 0.62, 0.30])
BLOCKED = np.array([0.80, 0.22, 0.18])
UNKNOWN = np.array([0.93, 0.72, 0.42])


def show_session(
    meshcat: Any, session: Session, found: FeasibilityMap | None = None
) -> None:
    """Draws the remaining tumour, cut open along the channel, and the snake.

    Args:
        meshcat: Where to draw.
        session: How things stand.
        found: Colours the surface: green where an elementary volume is feasible
            now, red where none is; far from its points the tumour's own colour.
    """
    volume = session.volume
    every = shown_spacing(volume)
    left = np.isin(volume.labels, (TUMOUR, CAP)) & (volume.tau == SOLID)
    y = volume.origin[1] + volume.spacing * np.arange(left.shape[1])
    left[:, y < 0.0] = False  # open towards the viewer
    vertices, faces = surface(
        coarse(left, every), volume.origin, every * volume.spacing
    )
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetCameraPose([0.03, -0.055, 0.02], [0.0, 0.0, 0.006])
    if found is None or len(found.points) == 0:
        meshcat.SetTriangleMesh("tumour", vertices.T, faces.T, TISSUE)
    else:
        away, nearest = cKDTree(found.points).query(vertices)
        colors = np.where(found.feasible[nearest, None], FEASIBLE, BLOCKED)
        colors = np.where((away > 2.5e-3)[:, None], UNKNOWN, colors)
        meshcat.SetTriangleColorMesh("tumour", vertices.T, faces.T, colors.T)
    show_snake(meshcat, session.postures[-1], session.params)
    tips = session.tips
    if len(tips) > 1:
        meshcat.SetLine("trail", tips.T, 1.0, Rgba(0.12, 0.37, 0.85, 0.6))
