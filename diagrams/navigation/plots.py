"""Plots of a navigation: the ways of the planners, and what happened when."""

from dataclasses import replace
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Circle
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.navigation.figures import (
    field_along,
    thesis_figures,
    total_potential,
)
from diagrams.navigation.metrics import gaps, goal_distance
from diagrams.navigation.perceived import perception
from diagrams.navigation.scenario import discs
from systems.switching.classical_planner import ClassicalParams
from systems.switching.signals import Seen
from systems.switching.statechart_planner import STATES
from systems.switching.switching_state import MODES

PLANNER_COLORS = {
    "switching": COLORS["robot"],
    "classical": COLORS["accent"],
    "statechart": COLORS["target"],
    "orca": COLORS["camera"],
}


def state_names(planner: str) -> tuple[str, ...]:
    """Names of a planner's states, by number."""
    alone = {"classical": ("sum of fields",), "orca": ("ORCA",)}
    return (alone | {"switching": MODES, "statechart": STATES})[planner]


def draw_world(axes: Any, run: Any, moments: int = 5) -> None:
    """Draws obstacles, fainter where they were earlier, start and goal.

    Time ends a little after the goal is reached.
    """
    obstacles = run.obstacles.rows
    arrival = run.metrics["time_to_target"]
    time = run.signals["time"]
    shown = time <= (time[-1] if arrival is None else arrival + 1.0)
    for x, y, radius in zip(
        obstacles.x[shown].T, obstacles.y[shown].T, obstacles.radius[0], strict=True
    ):
        if radius <= 0.0:
            continue
        track = np.column_stack([x, y])
        moves = np.ptp(track, axis=0).max() > 1e-6
        count = moments if moves else 1
        for share in np.linspace(0.0, 1.0, count):
            x, y = track[int(share * (len(track) - 1))]
            alpha = 0.75 if not moves else 0.12 + 0.5 * share
            disc = Circle((x, y), radius, color=COLORS["obstacle"], lw=0)
            disc.set_alpha(alpha)
            axes.add_patch(disc)
        if moves:
            axes.plot(*track.T, ":", color=COLORS["obstacle"], lw=0.8)
    for wall in run.scenario.walls:
        axes.plot(*np.transpose(wall.points), color="k", lw=2.0)
    axes.plot(*run.scenario.start, "o", color="k", ms=5)
    axes.plot(*run.scenario.goal, "*", color=COLORS["target"], ms=13, zorder=5)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")


def outcome(run: Any) -> str:
    """What became of a run, in a few words."""
    figures = run.metrics
    if figures["collided"]:
        return "collides"
    if figures["reached"]:
        return f"arrives after {figures['time_to_target']:.1f} s"
    return "does not arrive"


def draw_ways(axes: Any, runs: dict[str, Any]) -> None:
    """Draws the planners' ways, each until its run was decided."""
    for name, run in runs.items():
        robot = run.robot.state
        hit = np.flatnonzero(gaps(run).min(axis=1) <= 0.0)
        last = hit[0] if hit.size else len(robot.x) - 1
        label = f"{name}: {outcome(run)}"
        way = robot.x[: last + 1], robot.y[: last + 1]
        axes.plot(*way, color=PLANNER_COLORS[name], lw=1.8, label=label)
        if not run.metrics["reached"]:
            end = "X" if hit.size else "s"
            axes.plot(
                robot.x[last], robot.y[last], end, color=PLANNER_COLORS[name], ms=7
            )


def path(run: Any, runs: dict[str, Any]) -> Figure:
    """The ways of all compared planners in one picture."""
    figure = new_figure(7.5, 5.5)
    axes = add_axes(figure, 1, 1, 1)
    draw_world(axes, run)
    draw_ways(axes, runs)
    robot = run.robot.state
    radius = run.scenario.robot.radius
    for share in np.linspace(0.0, 1.0, 6):
        k = int(share * (len(robot.x) - 1))
        axes.add_patch(
            Circle((robot.x[k], robot.y[k]), radius, fill=False, color=COLORS["robot"])
        )
    axes.autoscale_view()
    figure.legend(loc="outside lower center", ncols=1)
    axes.set_title(run.scenario.description)
    return figure


def motion(run: Any) -> Figure:
    """Clearance, distance to the goal, speed and state over time."""
    figure = new_figure(7.5, 6.5)
    time = run.signals["time"]
    robot = run.robot.state
    upper = add_axes(figure, 3, 1, 1)
    gap = gaps(run).min(axis=1)
    upper.plot(time, gap, color=COLORS["obstacle"], label="nearest obstacle")
    upper.plot(time, goal_distance(run), color=COLORS["target"], label="goal")
    upper.axhline(0.0, color="k", lw=0.8)
    upper.set(ylabel="distance [m]", xlim=(0.0, time[-1]))
    upper.legend(loc="upper right")
    middle = add_axes(figure, 3, 1, 2, sharex=upper)
    middle.plot(time, robot.v, color=COLORS["robot"], label="speed [m/s]")
    middle.plot(time, robot.omega, color=COLORS["accent"], label="turn rate [rad/s]")
    middle.legend(loc="upper right")
    lower = add_axes(figure, 3, 1, 3, sharex=upper)
    names = state_names(run.scenario.planner)
    mode = np.round(run.planner.mode.state)
    lower.step(time, mode, where="post", color=COLORS["robot"])
    lower.set(xlabel="time [s]", yticks=range(len(names)), yticklabels=names)
    lower.set_ylim(-0.5, len(names) - 0.5)
    return figure


def potential(run: Any, runs: dict[str, Any]) -> Figure:
    """The classical total potential of the world, and the ways (Figure 8)."""
    s = run.scenario
    params, world = classical_world(s)
    middle = 0.5 * (np.array(s.start) + s.goal)
    half = np.maximum(np.abs(middle - s.start) + 1.0, 3.5)
    low, high = middle - half, middle + half
    figure = new_figure(7.5, 6.0)
    axes = add_axes(figure, 1, 1, 1)
    total_potential(axes, params, world, s.goal, low, high)
    draw_world(axes, run)
    draw_ways(axes, runs)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_title("Total potential of the classical method, and the ways")
    figure.legend(loc="outside lower center")
    return figure


def classical_world(scenario: Any) -> tuple[ClassicalParams, list[Seen]]:
    """The classical method's parameters, and what it sees at time zero."""
    body = scenario.robot
    params = replace(scenario.classical, body_radius=body.radius, speed=body.speed)
    return params, [Seen(float(k), *disc) for k, disc in enumerate(discs(scenario))]


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    runs = {run.scenario.planner: run, **run.case.companions}
    figures = {"path": path(run, runs), "motion": motion(run)}
    if run.scenario.senses == "lidar":
        figures["perception"] = perception(run)
    if run.scenario.thesis_figures:
        figures["potential"] = potential(run, runs)
        params, world = classical_world(run.scenario)
        ends = run.scenario.start, run.scenario.goal
        figures["field_along"] = field_along(params, world, *ends)
        figures |= thesis_figures()
    return figures
