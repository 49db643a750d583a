"""What the robot believes, held against what is true: figures, a plot, the replay."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from matplotlib.figure import Figure
import numpy as np
from pydrake.geometry import Box, Cylinder, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.navigation.scenario import mapping_params
from plants.turtlebot.lidar import RAYS, STEP
from plants.turtlebot.signals import RobotState
from systems.common.signal import size, view
from systems.perception.grid import OCCUPIED, absorb
from systems.perception.grid_mapping import SCAN_PERIOD, constants
from systems.perception.signals import CELLS, GRID, Cell

WALKS = 0.1
"""Speed [m/s] from which an obstacle counts as one that moves."""
SAME = 0.5
"""Distance [m] within which a track is one of an obstacle."""
SLOTS = 16
"""Tracks that the replay shows at a time."""
SPOKES = 24
"""Rays that the replay shows."""


class PlaceErrors(NamedTuple):
    """Believed less true place, (samples,) each."""

    distance: np.ndarray  # m
    heading: np.ndarray  # rad
    sigma: np.ndarray  # m, how wrong the robot believes to be


def place_errors(run: Any) -> PlaceErrors:
    """How far the robot is from where it believes to be."""
    believed, true, sure = run.mapping.place, run.robot.state, run.mapping.sureness
    distance = np.hypot(believed.x - true.x, believed.y - true.y)
    heading = np.abs(believed.theta - true.theta)
    return PlaceErrors(distance, heading, np.hypot(sure.x, sure.y))


class Walkers(NamedTuple):
    """Obstacles that move within sight, (n,) each: one row a sample and obstacle."""

    sample: np.ndarray
    obstacle: np.ndarray
    distance: np.ndarray  # m, of the nearest track; infinite if there is none
    velocity: np.ndarray  # m/s, of the two velocities


def walkers(run: Any) -> Walkers:
    """Who moves within sight, and the track that is nearest to each."""
    o, m, robot = run.obstacles.rows, run.tracking.moving, run.robot.state
    away = np.hypot(o.x - robot.x[:, None], o.y - robot.y[:, None])
    walks = (np.hypot(o.v_x, o.v_y) > WALKS) & (o.radius > 0.0)
    sample, obstacle = np.nonzero(walks & (away <= run.scenario.perception.vision))
    here = sample, obstacle
    gap = np.hypot(m.x[sample] - o.x[here][:, None], m.y[sample] - o.y[here][:, None])
    gap = np.where(m.track[sample] >= 0.0, gap, np.inf)
    nearest = sample, gap.argmin(axis=1)
    velocity = np.hypot(m.v_x[nearest] - o.v_x[here], m.v_y[nearest] - o.v_y[here])
    return Walkers(sample, obstacle, gap.min(axis=1, initial=np.inf), velocity)


def measure_perception(run: Any) -> dict[str, Any]:
    """Figures of what the robot believes."""
    errors, found = place_errors(run), walkers(run)
    seen = found.distance <= SAME
    last = RobotState(*(part[-1] for part in run.robot.state))
    goal = np.hypot(*(np.array(run.scenario.goal) - (last.x, last.y)))
    known = bool(seen.any())
    return {
        "goal_miss": float(goal),
        "max_place_error": float(errors.distance.max()),
        "max_heading_error": float(errors.heading.max()),
        "place_within_3_sigma": float(
            np.mean(errors.distance <= 3.0 * errors.sigma + 1e-9)
        ),
        "walkers_tracked": float(seen.mean()) if seen.size else None,
        "median_track_error": float(np.median(found.distance[seen])) if known else None,
        "median_track_velocity_error": (
            float(np.median(found.velocity[seen])) if known else None
        ),
    }


def grids(run: Any) -> Iterator[tuple[float, Any]]:
    """Time [s] and the grid after each scan, from what was logged.

    The grid is a `Cell` of squares (CELLS, CELLS), x first.
    """
    params = constants(mapping_params(run.scenario))
    grid = np.zeros((CELLS * CELLS, size(Cell)))
    time, place = run.signals["time"], run.mapping.place
    scans, moving = run.lidar.scan.r, run.tracking.moving
    every = round(SCAN_PERIOD / run.study.log_period)
    for k in range(0, len(time), every):
        here = RobotState(*(float(part[k]) for part in place))
        rows = np.column_stack([part[k] for part in moving])
        grid = absorb(params[0], grid, here, scans[k][:, None].copy(), rows)
        table = view(GRID, grid.ravel())
        yield float(time[k]), Cell(*(p.reshape(CELLS, CELLS) for p in table))


def draw_grid(axes: Any, run: Any, grid: Any) -> None:
    """The grid as a picture: dark what stands, white what is free."""
    params = mapping_params(run.scenario)
    half = 0.5 * CELLS * params.cell
    x, y = params.x, params.y
    axes.imshow(
        -grid.odds.T,
        extent=(x - half, x + half, y - half, y + half),
        origin="lower",
        cmap="gray",
        vmin=-3.0,
        vmax=3.0,
    )


def perception(run: Any) -> Figure:
    """True against believed: the map, the place and the walkers' velocities."""
    figure = new_figure(11.0, 6.0)
    left = add_axes(figure, 2, 2, (1, 3))
    *_, (_, grid) = grids(run)
    draw_grid(left, run, grid)
    for wall in run.scenario.walls:
        left.plot(*np.transpose(wall.points), "-", color=COLORS["target"], lw=1.0)
    o, m = run.obstacles.rows, run.tracking.moving
    there, told = o.radius > 0.0, m.track >= 0.0
    left.plot(o.x[there], o.y[there], ",", color=COLORS["obstacle"])
    left.plot(m.x[told], m.y[told], ",", color=COLORS["accent"])
    true, believed = run.robot.state, run.mapping.place
    left.plot(true.x, true.y, color=COLORS["robot"], lw=2.0, label="robot, true")
    left.plot(believed.x, believed.y, "--", color="k", lw=0.8, label="as it believes")
    left.plot([], [], "s", color=COLORS["obstacle"], label="obstacles, true")
    left.plot([], [], "s", color=COLORS["accent"], label="as tracked")
    left.plot(*run.scenario.goal, "*", color=COLORS["target"], ms=12)
    places = [run.scenario.start, run.scenario.goal]
    places += [point for wall in run.scenario.walls for point in wall.points]
    low, high = np.min(places, axis=0) - 1.0, np.max(places, axis=0) + 1.0
    reach = np.maximum(high - low, 8.0) / 2.0
    middle = (low + high) / 2.0
    (x0, y0), (x1, y1) = middle - reach, middle + reach
    left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    left.set(xlim=(x0, x1), ylim=(y0, y1))
    figure.legend(loc="outside lower left", ncols=4)
    time, errors = run.signals["time"], place_errors(run)
    upper = add_axes(figure, 2, 2, 2)
    upper.fill_between(time, 3e2 * errors.sigma, color=COLORS["muted"], alpha=0.3)
    upper.plot(time, 1e2 * errors.distance, color=COLORS["robot"])
    upper.set(ylabel="place: error, 3 sigma [cm]", xlabel="time [s]", ylim=(0, None))
    lower = add_axes(figure, 2, 2, 4)
    found = walkers(run)
    seen = found.distance <= SAME
    lower.plot(
        time[found.sample[seen]],
        found.velocity[seen],
        ".",
        ms=2,
        color=COLORS["accent"],
    )
    lower.plot(
        time[found.sample[~seen]], 0.0 * found.sample[~seen], "|", color="k", ms=8
    )
    lower.set(xlabel="time [s]", ylabel="walkers: velocity error [m/s]")
    lower.set(xlim=(0.0, time[-1]), ylim=(-0.05, 1.0))
    lower.set_title("strokes: one in sight is not tracked", fontsize=9)
    return figure


def decorate_perception(meshcat: Any, animation: Any, run: Any) -> None:
    """Where the robot believes to be, its rays, tracks and grid, in the replay."""
    time, believed = run.signals["time"], run.mapping.place
    meshcat.SetObject(
        "belief", Cylinder(1.05 * run.scenario.robot.radius, 0.02), Rgba(1, 1, 1, 0.8)
    )
    _draw_rays(meshcat, animation, run)
    _draw_tracks(meshcat, animation, run)
    _draw_grid(meshcat, animation, run)
    for t, x, y in zip(time, believed.x, believed.y, strict=True):
        X_WB = RigidTransform([x, y, 0.34])
        animation.SetTransform(animation.frame(t), "belief", X_WB)


def _draw_rays(meshcat: Any, animation: Any, run: Any) -> None:
    time, true = run.signals["time"], run.robot.state
    for spoke in range(SPOKES):
        k = spoke * RAYS // SPOKES
        path = f"rays/{spoke}"
        meshcat.SetObject(
            f"{path}/size/ray", Box(1.0, 0.008, 0.008), Rgba(1, 0.3, 0.2, 0.7)
        )
        meshcat.SetTransform(f"{path}/size/ray", RigidTransform([0.5, 0.0, 0.0]))
        for n in range(0, len(time), 4):
            frame = animation.frame(time[n])
            R_WR = RotationMatrix.MakeZRotation(true.theta[n] + k * STEP)
            X_WR = RigidTransform(R_WR, [true.x[n], true.y[n], 0.2])
            animation.SetTransform(frame, path, X_WR)
            length = max(float(run.lidar.scan.r[n, k]), 1e-3)
            animation.SetProperty(frame, f"{path}/size", "scale", [length, 1.0, 1.0])


def _draw_tracks(meshcat: Any, animation: Any, run: Any) -> None:
    time, m = run.signals["time"], run.tracking.moving
    for slot in range(min(SLOTS, m.x.shape[1])):
        if (m.track[:, slot] < 0.0).all():
            continue
        path = f"tracks/{slot}"
        meshcat.SetObject(
            f"{path}/size/disc", Cylinder(1.0, 0.05), Rgba(1.0, 0.6, 0.0, 0.5)
        )
        shown: bool | None = None
        for n in range(0, len(time), 2):
            there = bool(m.track[n, slot] >= 0.0)
            frame = animation.frame(time[n])
            if there != shown:
                animation.SetProperty(frame, path, "visible", there)
                shown = there
            if there:
                X_WT = RigidTransform([m.x[n, slot], m.y[n, slot], 0.43])
                animation.SetTransform(frame, path, X_WT)
                r = float(m.radius[n, slot])
                animation.SetProperty(frame, f"{path}/size", "scale", [r, r, 1.0])


def _draw_grid(meshcat: Any, animation: Any, run: Any) -> None:
    """Cells that are occupied, as they come and go, second by second."""
    cell = mapping_params(run.scenario).cell
    shown = np.zeros((CELLS, CELLS), bool)
    drawn: set[tuple[int, int]] = set()
    for n, (t, grid) in enumerate(grids(run)):
        if n % 10:
            continue
        stands = grid.odds >= OCCUPIED
        frame = animation.frame(t)
        for i, j in np.argwhere(stands != shown):
            path = f"grid/{i}_{j}"
            if (i, j) not in drawn:
                tile = Box(0.8 * cell, 0.8 * cell, 0.06)
                meshcat.SetObject(path, tile, Rgba(0.2, 0.2, 0.25, 0.9))
                place = [grid.x[i, j], grid.y[i, j], 0.03]
                meshcat.SetTransform(path, RigidTransform(place))
                animation.SetProperty(0, path, "visible", False)
                drawn.add((i, j))
            animation.SetProperty(frame, path, "visible", bool(stands[i, j]))
        shown = stands
