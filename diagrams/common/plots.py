"""One look for all plots."""

from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure
import numpy as np

COLORS = {
    "robot": "#1f5fa8",
    "target": "#2a8f4f",
    "obstacle": "#c8402f",
    "camera": "#444444",
    "accent": "#e0952a",
    "muted": "#9aa3ab",
}
"""Who is who, in all plots and replays."""

STYLE = {
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "axes.titlesize": 10.0,
}


def new_figure(width: float = 7.0, height: float = 4.2) -> Figure:
    """An empty figure in the project's style; size in inches."""
    with rc_context(STYLE):
        return Figure(figsize=(width, height), layout="constrained")


def add_axes(figure: Figure, *position: Any, **options: Any) -> Any:
    """Adds axes in the project's style; arguments as `Figure.add_subplot`."""
    with rc_context(STYLE):
        return figure.add_subplot(*position, **options)


def equal_axes(
    axes: Any,
    points: np.ndarray,
    margin: float = 2.0,
    elevation: float = 20.0,
    azimuth: float = -60.0,
    zoom: float = 1.0,
) -> None:
    """Same scale on all three axes of a view in space, round some points.

    Args:
        axes: 3D axes.
        points: Positions in mm, (n, 3).
        margin: About them in mm.
        elevation: Of the view in degrees.
        azimuth: Of the view in degrees.
        zoom: Of the box in its axes.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, (high - low).max() / 2 + margin
    for axis, centre in zip("xyz", middle, strict=True):
        axes.set(
            **{
                f"{axis}lim": (centre - half, centre + half),
                f"{axis}label": f"{axis} [mm]",
            }
        )
    axes.set_box_aspect((1, 1, 1), zoom=zoom)
    axes.view_init(elev=elevation, azim=azimuth)


def save_figure(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG, whatever the file is called."""
    with rc_context(STYLE):
        figure.savefig(path, format="png", dpi=140)


def png(figure: Figure) -> bytes:
    """A figure as PNG, for `IPython.display.Image` in a notebook."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.savefig(buffer, dpi=100)
    return buffer.getvalue()
