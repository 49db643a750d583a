"""The paper's Figures 5, 7 and 8 from a run's log."""

from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.bedside import wrist_plots
from diagrams.common.plots import COLORS, add_axes, equal_axes, new_figure
from diagrams.gauze import organ_plots
from diagrams.gauze.bypass_plots import clearance, forms
from diagrams.gauze.contact_plots import contact
from diagrams.gauze.scenario import PAPER
from diagrams.gauze.tools import TARGET, gap, logged
from systems.common.geometry import closest_points

MM = 1e3


def _shaft(axes: Any, p_WG: np.ndarray, p_WP: np.ndarray, **style: Any) -> None:
    """One tool from its fulcrum to its tip [mm]."""
    axes.plot(*np.column_stack([p_WG, p_WP]), solid_capstyle="round", **style)


def trajectory(run: Any) -> Figure:
    """The trajectory in 3-D with both of the surgeon's tools (Figures 7, 8 above)."""
    figure = new_figure(7.0, 6.0)
    axes = add_axes(figure, 1, 1, 1, projection="3d")
    tip, p_WG = run.robot.tool.tip * MM, run.robot.tool.fulcrum[0] * MM
    seen = [tip, p_WG]
    marks = max(1, len(tip) // 60)
    axes.plot(*tip.T, color=COLORS["robot"], lw=0.8)
    axes.plot(*tip[::marks].T, "*", color=COLORS["robot"], ms=4, label="robot's tip R")
    instants = np.linspace(0, len(tip) - 1, 5).astype(int)
    for index in instants:
        _shaft(axes, p_WG, tip[index], color=COLORS["robot"], lw=1.5, alpha=0.25)
    for tool in [*run.scenario.obstacles, run.scenario.target]:
        way, fulcrum = logged(run, tool).shaft.tip * MM, np.array(tool.p_WG) * MM
        color, is_target = COLORS[tool.role], tool.role == TARGET
        for index in () if is_target else instants:
            _shaft(axes, fulcrum, way[index], color=color, lw=2, alpha=0.3)
        label = "target S" if is_target else f"{tool.name} O".replace("_", " ")
        shown = way[-1 if is_target else 0]
        _shaft(axes, fulcrum, shown, color=color, lw=3, label=label)
        axes.plot(*way[::marks].T, ".", color=color, ms=3)
        seen += [way, fulcrum]
    equal_axes(axes, np.vstack(seen), margin=5.0, elevation=22)
    axes.legend(loc="upper left")
    axes.set_title(run.scenario.description)
    return figure


def speeds(run: Any) -> Figure:
    """Speeds of the robot's tip over time (Figures 7, 8 below), and the distances.

    The guide point's velocities v mean v / s at the tip. The obstacle's speed is that
    of its closest point: its tip's, by the share l/L.
    """
    figure = new_figure(7.0, 5.6)
    time = run.signals["time"]
    guide = run.planner.guide
    s = np.maximum(guide.s, run.scenario.navigation.min_proportion)
    v_1 = np.linalg.norm(run.planner.v1.v, axis=1) / s
    v_R = np.linalg.norm(run.planner.v_R.v, axis=1) / s
    upper = add_axes(figure, 2, 1, 1)
    upper.plot(time, v_R * MM, "-", color=COLORS["robot"], label="commanded v_R")
    upper.plot(time, v_1 * MM, "--", color=COLORS["accent"], label="field v_1")
    for tool in run.scenario.obstacles:
        v_O = np.linalg.norm(logged(run, tool).tip_velocity.v, axis=1) * guide.l_over_L
        label = f"{tool.name} at M_O".replace("_", " ")
        upper.plot(time, v_O * MM, ":", color=COLORS["obstacle"], label=label)
    upper.set(ylabel="speed of the tip [mm/s]", xlim=(0, time[-1]), ylim=(0, None))
    upper.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    clear = gap(run, "obstacle") * MM
    target = logged(run, run.scenario.target).shaft.tip
    error = np.linalg.norm(run.robot.tool.tip - target, axis=1)
    lower.plot(time, clear, color=COLORS["obstacle"], label="clearance to O")
    lower.plot(time, error * MM, color=COLORS["target"], label="tip to S's tip")
    lower.axhline(0.0, color="k", lw=0.6)
    for stop in run.metrics["stops"]:
        for axes in (upper, lower):
            end = stop["start"] + stop["duration"]
            axes.axvspan(stop["start"], end, color=COLORS["muted"], alpha=0.35, lw=0)
    if run.metrics["time_to_target"] is not None:
        lower.axvline(run.metrics["time_to_target"], color=COLORS["target"], ls="--")
    lower.set(xlabel="time [s]", ylabel="distance [mm]", ylim=(-3, None))
    lower.legend(ncols=2, loc="upper right")
    return figure


def forces(run: Any) -> Figure:
    """Force of the wall on the shaft, and how far the shaft is off the fulcrum."""
    figure = new_figure(7.0, 4.2)
    time = run.signals["time"]
    upper = add_axes(figure, 2, 1, 1)
    force = np.linalg.norm(run.wall.force.f, axis=1)
    upper.plot(time, force, color=COLORS["obstacle"])
    upper.set(ylabel="lateral force [N]", xlim=(0, time[-1]), ylim=(0, None))
    lower = add_axes(figure, 2, 1, 2, sharex=upper)
    lower.plot(time, run.wall.fulcrum_error.distance * MM, color=COLORS["robot"])
    lower.set(xlabel="time [s]", ylabel="shaft off fulcrum [mm]", ylim=(0, None))
    return figure


def virtual_force(run: Any) -> Figure:
    """The geometry of the virtual force (Figure 5) where R came closest to O."""
    figure = new_figure(7.0, 6.0)
    axes = add_axes(figure, 1, 1, 1, projection="3d")
    index = int(gap(run, "obstacle").argmin())
    p_WP, p_WG = (p[index] * MM for p in (run.robot.tool.tip, run.robot.tool.fulcrum))
    nearest = int(run.clearance.distance[index, : len(run.scenario.obstacles)].argmin())
    obstacle = run.scenario.obstacles[nearest]
    p_WO = logged(run, obstacle).shaft.tip[index] * MM
    p_WS = logged(run, run.scenario.target).shaft.tip[index] * MM
    p_WGO = np.array(obstacle.p_WG) * MM
    M_R, M_O = map(
        np.array,
        closest_points(*(tuple(x.tolist()) for x in (p_WG, p_WP, p_WGO, p_WO)))[3:],
    )
    s = np.linalg.norm(M_R - p_WG) / np.linalg.norm(p_WP - p_WG)
    M_Rf = p_WG + s * (p_WS - p_WG)
    _shaft(axes, p_WG, p_WP, color=COLORS["robot"], lw=4, label="robot's tool R")
    _shaft(axes, p_WGO, p_WO, color=COLORS["obstacle"], lw=4, label="obstacle tool O")
    _shaft(
        axes, p_WG, p_WS, color=COLORS["target"], lw=1.5, ls="--", label="target line"
    )
    _shaft(axes, M_R, M_O, color="k", lw=1.2, ls=":", label="distance rho")
    v_1 = run.planner.v1.v[index]
    to_goal = M_Rf - M_R
    size = 20.0
    for vector, color, label in (
        (to_goal, COLORS["target"], "attraction"),
        (M_R - M_O, COLORS["obstacle"], "repulsion"),
        (v_1, COLORS["accent"], "v1"),
    ):
        length = np.linalg.norm(vector)
        if length > 1e-9:
            way = vector / length * size
            axes.quiver(*M_R, *way, color=color, lw=2, arrow_length_ratio=0.25)
            axes.text(*(M_R + 1.15 * way), label, color=color)
    for point, name in (
        (p_WG, "G_R"),
        (p_WGO, "G_O"),
        (M_R, "M_R"),
        (M_O, "M_O"),
        (M_Rf, "M_R^f"),
        (p_WS, "P_S"),
    ):
        axes.plot(*point[:, None], "o", color="k", ms=3)
        axes.text(*point, f"  ${name}$", fontsize=8)
    equal_axes(
        axes, np.vstack([p_WG, p_WP, p_WGO, p_WO, p_WS]), margin=5.0, elevation=22
    )
    axes.legend(loc="upper left")
    axes.set_title(f"closest at {run.signals['time'][index]:.2f} s")
    return figure


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    figures = {
        "trajectory": trajectory(run),
        "speeds": speeds(run),
        "forces": forces(run),
        "virtual_force": virtual_force(run),
        "clearance": clearance(run),
    }
    if run.scenario.organs:
        figures["organs"] = organ_plots.organs(run)
    if run.scenario.held_tools.active:
        figures["contact"] = contact(run)
    if run.scenario.judge_sight:
        figures["sight"] = organ_plots.sight(run)
    if PAPER in run.case.companions:
        figures["forms"] = forms({"bypass": run, PAPER: run.case.companions[PAPER]})
    if run.scenario.emulated:
        start = run.scenario.measure_from
        figures["forces"] = wrist_plots.forces({run.scenario.wrist: run}, start)
        figures["estimate"] = wrist_plots.estimate(run, start)
    return figures
