"""One look for all plots."""

from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

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


def add_axes(figure: Figure, *position: int, **options: Any) -> Any:
    """Adds axes in the project's style; arguments as `Figure.add_subplot`."""
    with rc_context(STYLE):
        return figure.add_subplot(*position, **options)


def save_figure(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG."""
    with rc_context(STYLE):
        figure.savefig(path, dpi=140)


def png(figure: Figure) -> bytes:
    """A figure as PNG, for `IPython.display.Image` in a notebook."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.savefig(buffer, dpi=100)
    return buffer.getvalue()
