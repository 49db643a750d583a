"""The plot of a push: what the surgeon's tools, the wall and the robot feel of it."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.gauze.metrics import spans
from systems.common.stops import Stop

MOST = 5.0
"""What neither tool nor wall should bear more than [N]."""


def contact(run: Any) -> Figure:
    """Forces on the obstacle tools, in the hand and on the wall over time."""
    figure = new_figure(7.0, 3.4)
    axes, time = add_axes(figure, 1, 1, 1), run.signals["time"]
    n = len(time)
    force = np.linalg.norm(run.hand_force.f.reshape(n, -1, 3), axis=2).max(axis=1)
    grip = run.hand_force.grip.reshape(n, -1).max(axis=1)
    wall = np.linalg.norm(run.wall.force.f, axis=1)
    axes.plot(time, force, color=COLORS["obstacle"], label="R on O")
    axes.plot(time, grip, color=COLORS["accent"], label="of it in the hand")
    axes.plot(time, wall, color=COLORS["muted"], label="wall on R")
    if "wrist.touch" in run.logged:
        felt = np.linalg.norm(run.wrist.touch.f, axis=1)
        axes.plot(time, felt, "--", color=COLORS["robot"], lw=1.0, label="as R has it")
    for first, last in spans(np.round(run.navigation.stop.code) == Stop.TOUCHED):
        end = time[min(last + 1, n - 1)]
        axes.axvspan(time[first], end, color=COLORS["muted"], alpha=0.2, lw=0)
    axes.axhline(MOST, color="k", lw=0.8, ls=":")
    axes.set(xlabel="time [s]", ylabel="force [N]", xlim=(time[0], time[-1]))
    axes.set_ylim(0.0, None)
    axes.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    return figure
