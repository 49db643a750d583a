"""Plots of an operation: what happened in its phases, and the organ's breath."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.bedside.wrist_plots import estimate
from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.keyhole.metrics import AFTER, log_of_phases, tool_errors, working

MM = 1e3
SHADES = {
    "probe": "#f3e3c3",
    "approach": "#dfeaf6",
    "station": "#e8e4f2",
    "resect": "#e3f1e4",
    "retract": "#ececec",
    "stopped": "#f6d9d4",
}


def course(run: Any) -> Figure:
    """Force, tool error in the organ's frame and resected share, over the phases."""
    time = run.signals["time"]
    rows = 4 if run.case.resection is not None else 3
    figure = new_figure(8.0, 1.9 * rows)
    places = [add_axes(figure, rows, 1, row + 1) for row in range(rows)]
    phases = log_of_phases(run)
    ends = [*(one["start"] for one in phases[1:]), float(time[-1])]
    for axes in places:
        for one, end in zip(phases, ends, strict=True):
            axes.axvspan(one["start"], end, color=SHADES[one["phase"]], lw=0)
        axes.set_xlim(0.0, time[-1])
    for shade in dict.fromkeys(one["phase"] for one in phases):
        places[0].fill_between([], [], color=SHADES[shade], label=shade)
    places[0].legend(
        ncols=len(SHADES), loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8
    )
    force = np.linalg.norm(run.wall.force.f, axis=1)
    places[0].semilogy(time, np.maximum(force, 1e-3), color=COLORS["accent"], lw=0.7)
    places[0].set(ylabel="wall's force [N]", ylim=(2e-3, max(10.0, 2 * force.max())))
    error = np.where(working(run), tool_errors(run), np.nan) * MM
    places[1].plot(time, error, color=COLORS["robot"], lw=0.6, label="tool")
    organ = np.linalg.norm(run.organ.estimate.p - run.organ.true.p, axis=1) * MM
    sure = run.organ.estimate.sure > 0.5
    places[1].plot(
        time,
        np.where(sure, organ, np.nan),
        color=COLORS["target"],
        lw=0.5,
        alpha=0.7,
        label="organ's estimate",
    )
    places[1].set(ylabel="error [mm]", ylim=(0.0, None))
    places[1].legend(ncols=2, loc="upper right")
    tool, reference = run.snake.tool.p * MM, run.tip.reference.p * MM
    for axis, color in enumerate(("obstacle", "target", "robot")):
        places[2].plot(time, reference[:, axis], color=COLORS[color], lw=2.0, alpha=0.3)
        places[2].plot(
            time, tool[:, axis], color=COLORS[color], lw=0.6, label="xyz"[axis]
        )
    places[2].set(ylabel="tool in E [mm]")
    places[2].legend(ncols=3, loc="lower center", fontsize=7)
    if rows == 4:
        share = run.tissue.removed.tumour / run.case.session.volume.tumour_volume
        places[3].plot(time, 100 * share, color=COLORS["robot"])
        healthy = run.tissue.removed.healthy * 1e9
        twin = places[3].twinx()
        twin.plot(time, healthy, color=COLORS["obstacle"], lw=0.8)
        twin.set_ylabel("healthy [mm3]", color=COLORS["obstacle"])
        places[3].set(ylabel="resected [%]", ylim=(0.0, 100.0))
    places[-1].set_xlabel("time [s]")
    return figure


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    return {"course": course(run), "estimate": estimate(run, AFTER)}
