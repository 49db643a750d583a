"""Plots of the bypass: the clearance over time, and several forms side by side."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.gauze.tools import CAMERA, OBSTACLE, TARGET, gap, logged

MM = 1e3


FARTHEST = 40.0
"""Clearance that is drawn [mm]."""


def clearance(run: Any) -> Figure:
    """Clearances to all tools over time, and what the constraint and the bypass do."""
    figure = new_figure(7.0, 5.2)
    time = run.signals["time"]
    upper = add_axes(figure, 2, 1, 1)
    for who, name in (
        (OBSTACLE, "O"),
        (TARGET, "S (touched at the hand-over)"),
        (CAMERA, "endoscope"),
    ):
        far = gap(run, who) * MM
        if far.min() < FARTHEST:
            upper.plot(time, far, color=COLORS[who], label=name)
    upper.axhline(0.0, color="k", lw=0.8)
    upper.set(ylabel="clearance [mm]", ylim=(-6.0, FARTHEST), xlim=(time[0], time[-1]))
    if upper.lines[1:]:  # of what is not far all the time
        upper.legend(ncols=3, loc="upper right")
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    status = run.planner.clearance
    lower.plot(time, status.change * MM, color=COLORS["robot"], label="changed")
    fails = (status.near > 0.5) & (status.condition < 0.5)
    marks = [
        ("dodging", status.dodge > 0.5, COLORS["accent"]),
        ("evasion condition fails", fails, COLORS["obstacle"]),
    ]
    if "planner.way" in run.logged:
        marks.append(("waiting", run.planner.way.waiting > 0.5, COLORS["muted"]))
    top = max(10.0, 1.05 * float(status.change.max()) * MM)
    for name, flags, color in [one for one in marks if one[1].any()]:
        lower.fill_between(
            time, 0.0, top, where=flags, color=color, alpha=0.3, lw=0, label=name
        )
    lower.set(xlabel="time [s]", ylabel="change of velocity [mm/s]", ylim=(0.0, top))
    lower.legend(ncols=2, loc="upper right")
    return figure


def forms(runs: dict[str, Any]) -> Figure:
    """The same scene under several forms of the planner: ways, distance left, speed.

    Args:
        runs: Runs of one scenario, by what to call them.
    """
    figure = new_figure(9.0, 4.4)
    axes = add_axes(figure, 1, 2, 1, projection="3d")
    beside, below = add_axes(figure, 2, 2, 2), add_axes(figure, 2, 2, 4)
    colors = [COLORS["robot"], COLORS["accent"], COLORS["muted"], COLORS["camera"]]
    first = next(iter(runs.values()))
    ends = []
    scene = first.scenario
    for tool in [*scene.obstacles, scene.target]:
        fulcrum = np.array(tool.p_WG) * MM
        tip = logged(first, tool).shaft.tip[-1] * MM
        axes.plot(*np.column_stack([fulcrum, tip]), color=COLORS[tool.role], lw=4)
        axes.text(
            *tip, "  S" if tool.role == TARGET else "  O", color=COLORS[tool.role]
        )
        ends += [fulcrum, tip]
    for (name, run), color in zip(runs.items(), colors, strict=False):
        tip, p_WG = run.robot.tool.tip * MM, run.robot.tool.fulcrum * MM
        axes.plot(*tip.T, color=color, lw=2.2, label=name)
        axes.plot(*tip[-1:].T, "o", color=color, ms=6)
        axes.plot(*np.stack([p_WG[-1], tip[-1]]).T, color=color, lw=1, ls=":")
        left = np.linalg.norm(tip - logged(run, scene.target).shaft.tip * MM, axis=1)
        beside.plot(run.signals["time"], left, color=color, label=name)
        speed = np.linalg.norm(run.navigation.tool.v, axis=1) * MM
        below.plot(run.signals["time"], speed, color=color)
        ends += [p_WG[0], *tip[::10]]
    points = np.array(ends)
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2.0, (high - low).max() / 2.0
    axes.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        zlim=(middle[2] - half, middle[2] + half),
        title="fulcrums, shafts and ways of the tip [mm]",
    )
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=24, azim=-62)
    beside.set(ylabel="from the target [mm]", ylim=(0, None))
    below.set(xlabel="time [s]", ylabel="tip's speed [mm/s]", ylim=(0, None))
    beside.legend(loc="upper right")
    return figure
