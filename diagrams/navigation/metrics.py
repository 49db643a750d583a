"""The figures of a navigation, all from true quantities."""

from typing import Any

import numpy as np

from diagrams.navigation.perceived import measure_perception
from diagrams.navigation.scenario import outruns
from plants.crowd.walls import wall_distance


def gaps(run: Any) -> np.ndarray:
    """Distance between surfaces, (samples, obstacles) [m]; infinite for none."""
    robot, obstacles = run.robot.state, run.obstacles.rows
    distance = np.hypot(obstacles.x - robot.x[:, None], obstacles.y - robot.y[:, None])
    gap = distance - obstacles.radius - run.scenario.robot.radius
    return np.where(obstacles.radius > 0.0, gap, np.inf)


def goal_distance(run: Any) -> np.ndarray:
    """Distance from the goal (samples,) [m]."""
    robot = run.robot.state
    x, y = run.scenario.goal
    return np.hypot(robot.x - x, robot.y - y)


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them.

    Clearance and path count until the goal is reached.
    """
    time = run.signals["time"]
    robot = run.robot.state
    near = np.flatnonzero(goal_distance(run) <= run.scenario.reach)
    last = int(near[0]) if near.size else len(time) - 1
    clearance = float(gaps(run)[: last + 1].min())
    if run.scenario.walls:
        places = np.column_stack([robot.x, robot.y])[: last + 1]
        to_walls = wall_distance(run.scenario.walls, places)
        clearance = min(clearance, float(to_walls.min()) - run.scenario.robot.radius)
    steps = np.hypot(np.diff(robot.x[: last + 1]), np.diff(robot.y[: last + 1]))
    straight = float(goal_distance(run)[0])
    mode = run.planner.mode
    switches = np.diff(np.round(mode.state[: last + 1]))
    outrun = np.round(mode.outrun[: last + 1])
    collided = clearance <= 0.0
    figures = {
        "reached": bool(near.size) and not collided,
        "collided": collided,
        "time_to_target": float(time[last]) if near.size else None,
        "min_clearance": clearance if np.isfinite(clearance) else None,
        "path_ratio": float(steps.sum()) / straight,
        "mode_switches": int(np.count_nonzero(switches)),
        "outrun_time": float(outrun.mean() * time[last]),
        "faster_obstacles": outruns(run.scenario),
    }
    if run.scenario.senses == "lidar":
        figures |= measure_perception(run)
    return figures
