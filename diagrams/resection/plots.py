"""Plots of a resection: plan and resected area (Figure 8), and a page of report."""

from typing import Any

from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, equal_axes, new_figure
from diagrams.resection.metrics import carving_of, times_of
from diagrams.resection.replay import coarse, shown_spacing
from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from systems.resection.planning.session import STROKES

MM = 1e3
STEP_COLORS = ("#222222", "#c8402f", "#e5b80b", "#2a8f4f", "#8e5bb0")
CUT = ListedColormap(["#f4f1ee", "#e8b56a", "#ffffff", "#dbe7f3", "#b01820", "#c060c0"])
"""Brain, tumour, removed, channel and cap, critical, healthy tissue removed."""


STROKE_COLOR = "#1f5fa8"
"""Of strokes."""


def step_colors(steps: list[Any]) -> list[str]:
    """Colours of a plan's steps: procedures in turn, strokes all alike."""
    colors, number = [], 0
    for step in steps:
        if step.kind == STROKES:
            colors.append(STROKE_COLOR)
        else:
            colors.append(STEP_COLORS[number % len(STEP_COLORS)])
            number += 1
    return colors


def _mesh(axes: Any, mask: np.ndarray, volume: Any, color: str, alpha: float) -> None:
    every = 2 * shown_spacing(volume)
    small = coarse(mask, every)
    if not small.any():
        return
    vertices, faces = surface(small, volume.origin, every * volume.spacing)
    if len(faces) == 0:
        return  # too little to be seen
    axes.plot_trisurf(
        *(MM * vertices.T), triangles=faces, color=color, alpha=alpha, lw=0, shade=True
    )


def _equal(axes: Any, volume: Any) -> None:
    points = volume.points(volume.labels == TUMOUR)[::50] * MM
    equal_axes(axes, points, elevation=18, azimuth=-62, zoom=0.86)
    axes.invert_zaxis()


def figure8(run: Any) -> Figure:
    """Trajectory coloured by procedure, and the resected area beside it (Figure 8)."""
    session = run.case.session
    volume = session.volume
    figure = new_figure(10.0, 5.2)
    left = add_axes(figure, 1, 2, 1, projection="3d", computed_zorder=False)
    _mesh(left, volume.labels == TUMOUR, volume, "#c9c2ba", 0.12)
    tips = session.tips * MM
    chosen = [step for step in session.steps if step.kind != "home"]
    labelled = [step.name for step in chosen if step.kind != STROKES][:8]
    for step, color in zip(chosen, step_colors(chosen), strict=True):
        path = tips[max(step.first - 1, 0) : step.last]
        label = step.name if step.name in labelled else None
        strokes = step.kind == STROKES  # there are many: behind the others
        if step.name == "strokes 1":
            label = "strokes"
        look = {"lw": 0.5, "zorder": 2} if strokes else {"lw": 0.6, "zorder": 3}
        left.plot(*path.T, color=color, label=label, **look)
    _equal(left, volume)
    if chosen:
        legend = left.legend(loc="upper left", fontsize=7)
        for line in legend.get_lines():
            line.set_linewidth(2.0)
    left.set_title("trajectory of the tool", y=0.95)
    right = add_axes(figure, 1, 2, 2, projection="3d")
    removed = (volume.labels == TUMOUR) & (carving_of(run).volume.tau != SOLID)
    _mesh(right, volume.labels == TUMOUR, volume, "#c9c2ba", 0.12)
    _mesh(right, removed, volume, "#e5b80b", 0.9)
    _equal(right, volume)
    share = run.metrics["resected_fraction"]
    right.set_title(f"resected: {100 * share:.1f} % of the tumour", y=0.95)
    return figure


def section(volume: Any, tau: np.ndarray, axis: int) -> np.ndarray:
    """Codes of a cut along the channel through its axis, (n, nz)."""
    index = volume.index_of(np.zeros(3))[axis]
    labels = np.take(volume.labels, index, axis=axis)
    gone = np.take(tau, index, axis=axis) != SOLID
    code = np.zeros(labels.shape, int)
    code[labels == TUMOUR] = 1
    code[(labels == TUMOUR) & gone] = 2
    code[(labels == CHANNEL) | (labels == CAP)] = 3
    code[labels == CRITICAL] = 4
    code[(labels == BRAIN) & gone] = 5
    return code


def report(run: Any) -> Figure:
    """One page: volumes, coverage, cuts before and after, timeline, what stayed."""
    session, volume = run.case.session, run.case.session.volume
    tau = carving_of(run).volume.tau
    figure = new_figure(11.7, 8.3)
    figure.suptitle(f"{run.scenario.description} ({run.case.tumour})", fontsize=12)
    grid = figure.add_gridspec(3, 4, height_ratios=[1.0, 0.9, 0.9])
    size = np.array(volume.labels.shape) * volume.spacing
    for number, (axis, when) in enumerate(((1, 0), (1, 1), (0, 0), (0, 1))):
        axes = figure.add_subplot(grid[0, number])
        state = tau if when else np.where(tau == 0, 0, SOLID)
        across = 1 - axis
        low = MM * volume.origin
        extent = (
            low[across],
            low[across] + MM * size[across],
            low[2] + MM * size[2],
            low[2],
        )
        axes.imshow(
            section(volume, state, axis).T,
            extent=extent,
            cmap=CUT,
            vmin=-0.5,
            vmax=5.5,
            interpolation="nearest",
        )
        axes.grid(False)
        name = "xy"[across]
        axes.set(xlabel=f"{name} [mm]", ylabel="z [mm]" if number == 0 else "")
        axes.set_title(f"{name}z, {'after' if when else 'before'}")
    _timeline(figure.add_subplot(grid[1, :]), run)
    _gains(figure.add_subplot(grid[2, 0]), session)
    left = figure.add_subplot(grid[2, 1:3])
    left.axis("off")
    left.text(0, 1, _figures(run.metrics), va="top", fontsize=8.5, linespacing=1.45)
    right = figure.add_subplot(grid[2, 3])
    right.axis("off")
    right.text(0, 1, _stayed(run.case), va="top", fontsize=8.0, linespacing=1.4)
    return figure


def _timeline(axes: Any, run: Any) -> None:
    session = run.case.session
    before = run.case.done.time  # what an earlier run carried out
    time = before + run.signals["time"]
    share = run.tissue.removed.tumour / session.volume.tumour_volume
    axes.plot(time / 60, 100 * share, color=COLORS["robot"], lw=1.6)
    reach = 100 * run.case.reach.fraction
    axes.axhline(reach, color=COLORS["target"], lw=1.0, ls="--")
    times = (before + times_of(run)) / 60
    colors = step_colors(session.steps)
    axes.set(
        xlabel="time [min]",
        ylabel="resected [%]",
        ylim=(0, 105),
        xlim=(before / 60, time[-1] / 60),
    )
    axes.text(
        before / 60, reach + 0.8, " reachable", color=COLORS["target"], fontsize=8
    )
    axes.grid(alpha=0.3)
    for step, color in zip(session.steps, colors, strict=True):
        if step.kind == "home":
            continue
        first = times[max(step.first - 1, 0)]
        last = times[min(step.last - 1, len(times) - 1)]
        axes.axvspan(first, last, ymax=0.05, color=color, lw=0)


def _gains(axes: Any, session: Any) -> None:
    steps = [step for step in session.steps if step.kind != "home"]
    gains = np.array([step.gained for step in steps]) * 1e6
    axes.bar(np.arange(1, len(steps) + 1), gains, color=step_colors(steps))
    axes.set(xlabel="step of the plan", ylabel="removes [cm³]")
    axes.grid(axis="y", alpha=0.3)


def _figures(m: dict[str, Any]) -> str:
    critical, mask = m["min_critical_distance"], m["mask_volume"]
    rows = [
        f"tumour {1e6 * m['tumour_volume']:.2f} cm³ (without the channel's cap of "
        f"{1e6 * m['cap_volume']:.2f} cm³; it bores {1e6 * m['channel_volume']:.2f} "
        "cm³ of brain here)" + (f", in the mask {1e6 * mask:.2f} cm³" if mask else ""),
        f"reachable {100 * m['reachable_fraction']:.1f} %, planned "
        f"{100 * m['planned_fraction']:.1f} %, resected "
        f"{100 * m['resected_fraction']:.1f} % of the tumour",
        f"healthy tissue removed {1e9 * m['healthy_removed']:.1f} mm³, nowhere deeper "
        f"than {1e3 * m['max_outside_depth']:.2f} mm",
        "nothing critical near"
        if critical is None
        else f"nearest to what is critical {1e3 * critical:.2f} mm",
        f"body in tissue at {m['body_collisions']} checks",
        f"{m['entries']} entries, the further ones bored "
        f"{1e6 * m['bored_healthy']:.2f} cm³ of healthy tissue",
        f"{m['procedures']} procedures, {m['strokes']} strokes; single steps "
        f"{100 * m['single_step_share']:.1f} %",
        f"planned in {m['planning_time']:.1f} s, reach in {m['reach_time']:.1f} s",
        f"carried out in {m['execution_time'] / 60:.1f} min, tool path "
        f"{m['path_length']:.1f} m",
        f"tool within {1e3 * m['max_tool_error']:.3f} mm of the plan",
    ]
    for refusal in m["refusals"][:6]:
        rows.append(
            f"refused: {refusal['procedure']}, {refusal['reason']}, by "
            f"{1e3 * refusal['gap']:.2f} mm"
        )
    return "\n".join(rows)


def _stayed(case: Any) -> str:
    volume = case.session.volume
    count = 1 + len(volume.more)
    rows = [f"what {'one entry' if count == 1 else f'{count} entries'} cannot reach"]
    for lump in case.reach.lumps[:9]:
        share = 100 * lump.volume / volume.tumour_volume
        shown = f"{share:.1f} %" if share >= 0.1 else "< 0.1 %"
        rows.append(f"{1e9 * lump.volume:.0f} mm³ ({shown}): {lump.reason}")
    if len(rows) == 1:
        rows.append("nothing")
    return "\n".join(rows)


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    return {"figure8": figure8(run), "report": report(run)}
