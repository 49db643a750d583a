"""Plots of organs and of the camera: clearance, touch, what is seen."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.gauze.sight import margins

MM = 1e3


def organs(run: Any) -> Figure:
    """Clearance to every organ over time, and the force of the tissue."""
    figure = new_figure(7.0, 5.2)
    time = run.signals["time"]
    upper = add_axes(figure, 2, 1, 1)
    for k, organ in enumerate(run.scenario.organs):
        gap = run.organs.gaps.distance[:, k]
        upper.plot(time, gap * MM, label=organ.name.replace("_", " "))
    upper.axhline(0.0, color="k", lw=0.8)
    upper.set(ylabel="clearance [mm]", ylim=(-4.0, 60.0), xlim=(time[0], time[-1]))
    upper.legend(ncols=3, loc="upper right")
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    force = np.linalg.norm(run.organs.touch.f, axis=1)
    lower.plot(time, force, color=COLORS["robot"], label="tissue, true")
    if run.scenario.press.active:
        known = run.press.touch.force
        lower.plot(time, known, color=COLORS["accent"], label="as R has it")
        lower.axhline(run.scenario.press.force, color="k", lw=0.8, ls=":")
    wall = np.linalg.norm(run.wall.force.f, axis=1)
    lower.plot(time, wall, color=COLORS["muted"], label="wall, across")
    lower.set(xlabel="time [s]", ylabel="force on the tool [N]", ylim=(-0.05, None))
    lower.legend(ncols=3, loc="upper left")
    return figure


def sight(run: Any) -> Figure:
    """Margins of both tips in the picture over time; below zero they are unseen."""
    figure = new_figure(7.0, 3.0)
    axes = add_axes(figure, 1, 1, 1)
    time, both = run.signals["time"], margins(run)
    axes.plot(time, both[:, 0], color=COLORS["robot"], label="R's tip")
    axes.plot(time, both[:, 1], color=COLORS["target"], label="S's tip")
    axes.axhline(0.0, color="k", lw=0.8)
    axes.set(xlabel="time [s]", ylabel="margin at the lens [rad]")
    axes.legend()
    return figure
