"""The figures of a navigation, all from true quantities."""

from typing import Any

import numpy as np

from diagrams.navigation.scenario import outruns


def gaps(run: Any) -> np.ndarray:
    """Distance between surfaces, (samples, obstacles) [m]; infinite for none."""
    robot = run.matrix("robot.state")
    rows = run.matrix("obstacles.rows").reshape(len(robot), -1, 5)
    distance = np.hypot(
        rows[:, :, 0] - robot[:, None, 0], rows[:, :, 1] - robot[:, None, 1]
    )
    gap = distance - rows[:, :, 2] - run.scenario.robot.radius
    return np.where(rows[:, :, 2] > 0.0, gap, np.inf)


def goal_distance(run: Any) -> np.ndarray:
    """Distance from the goal (samples,) [m]."""
    robot = run.matrix("robot.state")
    goal = run.scenario.goal
    return np.hypot(robot[:, 0] - goal[0], robot[:, 1] - goal[1])


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them.

    Clearance and path count until the goal is reached.
    """
    time = run.signals["time"]
    robot = run.matrix("robot.state")
    near = np.flatnonzero(goal_distance(run) <= run.scenario.reach)
    last = int(near[0]) if near.size else len(time) - 1
    clearance = float(gaps(run)[: last + 1].min())
    steps = np.hypot(*np.diff(robot[: last + 1, :2], axis=0).T)
    straight = float(goal_distance(run)[0])
    mode = np.round(run.matrix("planner.mode"))
    collided = clearance <= 0.0
    return {
        "reached": bool(near.size) and not collided,
        "collided": collided,
        "time_to_target": float(time[last]) if near.size else None,
        "min_clearance": clearance if np.isfinite(clearance) else None,
        "path_ratio": float(steps.sum()) / straight,
        "mode_switches": int(np.count_nonzero(np.diff(mode[: last + 1, 0]))),
        "outrun_time": float(mode[: last + 1, 4].mean() * time[last]),
        "faster_obstacles": outruns(run.scenario),
    }
