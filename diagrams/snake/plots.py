"""Plots of a moving snake: where it went, how far off, and what the wires did."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, equal_axes, new_figure
from diagrams.snake.metrics import break_time, errors, judged, swings
from plants.snake.actuation import wire_lengths
from plants.snake.balls import corners_of, turns_of, turns_of_angles
from plants.snake.parameters import MODULES, WIRES
from plants.snake.posture import posture_of

MM = 1e3
MODULE_COLORS = ("#d93329", "#1a8c47", "#2159cc")
STYLES = ("-", "--", ":")


def _events(run: Any, *panels: Any) -> None:
    """Marks a snapping wire and the alarm."""
    snapped = break_time(run.scenario)
    alarm = float(run.watch.alarm.time[-1])
    for axes in panels:
        if snapped is not None:
            axes.axvline(snapped, color="k", lw=1.0, label="wire snaps")
        if alarm >= 0.0:
            axes.axvline(alarm, color=COLORS["accent"], lw=1.5, ls="--", label="alarm")


def turns_in(run: Any) -> np.ndarray:
    """R_i of the six balls in each sample, (n, 6, 3, 3)."""
    if run.scenario.wires == "statics":
        return turns_of_angles(run.snake.balls.q)
    return np.array([turns_of(x) for x in posture_of(run.snake.posture.q)])


def path(run: Any) -> Figure:
    """The snake in some postures, and its tip's path with the reference."""
    figure = new_figure(7.0, 6.0)
    axes = add_axes(figure, 1, 1, 1, projection="3d")
    time, tip = run.signals["time"], run.scenario.tip
    tool = run.snake.tool.p * MM
    reference = run.tip.reference.p * MM
    if tip.poses:
        shown = (
            np.arange(tip.dwell, time[-1] + 1e-6, tip.dwell)[: len(tip.poses)] - 0.02
        )
    else:
        shown = tip.circle.ramp + tip.circle.period * np.arange(6) / 6
    points = corners_of(turns_in(run), run.snake.posture.q[:, 0], run.scenario.snake)
    points *= MM
    for i in np.searchsorted(time, shown[shown <= time[-1]]):
        body = points[min(i, len(points) - 1)]
        axes.plot(*body.T, color=COLORS["robot"], lw=4, alpha=0.25)
        axes.plot(*body[:6].T, "o", color=COLORS["accent"], ms=3.5, alpha=0.6)
    style = {"color": COLORS["target"], "label": "reference"}
    if tip.poses:
        axes.plot(*reference.T, "x", ms=7, **style)
    else:
        axes.plot(*reference.T, lw=3, alpha=0.5, **style)
    axes.plot(*tool.T, color=COLORS["robot"], lw=1.0, label="tip")
    equal_axes(axes, points.reshape(-1, 3))
    axes.legend(loc="upper left")
    axes.set_title(run.scenario.description)
    return figure


def pose_errors(run: Any) -> Figure:
    """Tip and axis against the reference; grey where they count."""
    figure = new_figure(7.0, 4.6)
    time, flags = run.signals["time"], judged(run)
    position, angle = errors(run)
    upper = add_axes(figure, 2, 1, 1)
    upper.semilogy(time, position * MM, color=COLORS["robot"], lw=1.0)
    upper.set(ylabel="tip error [mm]", xlim=(0, time[-1]))
    upper.set_ylim(bottom=max(1e-4, upper.get_ylim()[0]))  # it starts without any
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    lower.semilogy(time, np.degrees(angle), color=COLORS["target"], lw=1.0)
    lower.set(ylabel="axis error [deg]", xlabel="time [s]")
    lower.set_ylim(bottom=max(1e-3, lower.get_ylim()[0]))
    if not flags.all():
        edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
        for first, last in edges.reshape(-1, 2):
            for axes in (upper, lower):
                end = time[min(last, len(time) - 1)]
                axes.axvspan(time[first], end, color=COLORS["muted"], alpha=0.35, lw=0)
    _events(run, upper, lower)
    return figure


def wires(run: Any) -> Figure:
    """What the drums wound, from the straight robot's lengths, and the tensions."""
    figure = new_figure(7.4, 5.6)
    time = run.signals["time"]
    straight = wire_lengths(np.zeros(7), run.scenario.snake)
    change = (run.drums.lengths.wires - straight) * MM
    tension = run.wires.tension.T
    upper = add_axes(figure, 2, 1, 1)
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    for w in range(WIRES * MODULES):
        style = {"color": MODULE_COLORS[w // WIRES], "ls": STYLES[w % WIRES], "lw": 1.0}
        upper.plot(
            time, change[:, w], label=f"{w // WIRES + 1}.{w % WIRES + 1}", **style
        )
        lower.plot(time, tension[:, w], **style)
    upper.set(ylabel="wound out [mm]", xlim=(0, time[-1]))
    lower.set(ylabel="tension [N]", xlabel="time [s]", ylim=(0, None))
    upper.legend(title="wire", loc="center left", bbox_to_anchor=(1.0, 0.5))
    _events(run, upper, lower)
    if break_time(run.scenario) is not None:
        lower.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def break_closeup(run: Any) -> Figure:
    """Tensions, residual and drums around the instant at which a wire snaps."""
    figure = new_figure(7.4, 6.0)
    time, snapped = run.signals["time"], break_time(run.scenario) or 0.0
    near = (time > snapped - 0.2) & (time < snapped + 0.4)
    top = add_axes(figure, 3, 1, 1)
    tension = run.wires.tension.T[near]
    for w in range(WIRES * MODULES):
        style = {"color": MODULE_COLORS[w // WIRES], "ls": STYLES[w % WIRES]}
        top.plot(time[near], tension[:, w], lw=1.2, **style)
    top.axhline(run.scenario.watch.least, color=COLORS["muted"], lw=0.8)
    top.set(ylabel="tension [N]", ylim=(0, None))
    middle = add_axes(figure, 3, 1, 2, sharex=top)
    residual = np.abs(run.wires.residual.modules[near])
    for m in range(MODULES):
        color, label = MODULE_COLORS[m], f"module {m + 1}"
        middle.semilogy(time[near], residual[:, m] + 1e-9, color=color, label=label)
    middle.set(ylabel="wires disagree")
    middle.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    bottom = add_axes(figure, 3, 1, 3, sharex=top)
    drums = np.column_stack(run.drums.lengths)
    rates = np.gradient(drums, time, axis=0)[near]
    bottom.plot(time[near], np.abs(rates).max(axis=1) * MM, color=COLORS["robot"])
    bottom.set(ylabel="fastest drum [mm/s]", xlabel="time [s]", ylim=(0, None))
    _events(run, top, middle, bottom)
    bottom.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def statics(run: Any) -> Figure:
    """What the paper takes to be zero, and how far the snake is from being lost."""
    figure = new_figure(7.4, 6.4)
    time, gaps = run.signals["time"], run.snake.gaps
    position, _ = errors(run)
    top = add_axes(figure, 3, 1, 1)
    top.plot(time, position * MM, color=COLORS["robot"])
    top.set(ylabel="tip error [mm]", xlim=(0, time[-1]), ylim=(0, None))
    force = np.linalg.norm(run.tool.force.f, axis=1)
    if force.any():
        right = top.twinx()
        right.plot(time, force, color=COLORS["obstacle"], ls="--")
        right.set_ylabel("force on the tool [N]", color=COLORS["obstacle"])
        right.grid(False)
    middle = add_axes(figure, 3, 1, 2, sharex=top)
    for m in range(MODULES):
        style = {"color": MODULE_COLORS[m], "lw": 1.2}
        split = np.degrees(gaps.split[:, m])
        middle.plot(time, split, label=f"split {m + 1}", **style)
        for half, name in enumerate(("near", "far")):
            torsion = np.degrees(gaps.torsion[:, 2 * m + half])
            line = STYLES[1 + half]
            label = f"torsion {m + 1} {name}"
            middle.plot(time, torsion, label=label, ls=line, **style)
    middle.set(ylabel="split, torsion [deg]")
    middle.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
    bottom = add_axes(figure, 3, 1, 3, sharex=top)
    least = run.wires.stability.least_eigenvalue
    bottom.plot(time, 1e3 * least, color=COLORS["robot"])
    bottom.axhline(0.0, color="k", lw=0.8)
    bottom.set(ylabel="least eigenvalue\n[mN m/rad]", xlabel="time [s]")
    bottom.set_yscale("symlog", linthresh=10.0)  # what friction holds is stiff
    _events(run, top, middle, bottom)
    if run.watch.alarm.time[-1] >= 0.0:
        bottom.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def loop(run: Any) -> Figure:
    """The tool in the last swing, there and back, against the bend asked for."""
    figure = new_figure(7.0, 4.6)
    pairs, swing = swings(run) * MM, run.scenario.tip.swing
    bend = np.degrees(max(swing.bends)) * np.sin(np.linspace(-0.5, 0.5, 201) * np.pi)
    across = np.array([np.cos(swing.azimuth), np.sin(swing.azimuth), 0.0])
    upper, lower = add_axes(figure, 1, 2, 1), add_axes(figure, 1, 2, 2)
    for k, (name, color) in enumerate((("there", "robot"), ("back", "target"))):
        upper.plot(bend, pairs[:, k] @ across, color=COLORS[color], label=name)
    upper.set(xlabel="bend asked for [deg]", ylabel="tool, across [mm]")
    upper.legend()
    apart = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1)
    lower.plot(bend, apart, color=COLORS["accent"])
    lower.set(
        xlabel="bend asked for [deg]", ylabel="there from back [mm]", ylim=(0, None)
    )
    return figure


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    figures = {"path": path(run), "errors": pose_errors(run), "wires": wires(run)}
    if run.scenario.wires == "statics":
        figures["statics"] = statics(run)
        if len(swings(run)):
            figures["loop"] = loop(run)
    snapped = break_time(run.scenario)
    if snapped is not None and snapped < run.signals["time"][-1]:
        figures["break"] = break_closeup(run)
    return figures
