"""The figures of a moving snake."""

from typing import Any

import numpy as np

SETTLED = 0.3
"""Errors at a pose count over the last so many seconds of its dwell."""


def break_time(scenario: Any) -> float | None:
    """When the first wire snaps [s]; None if none does."""
    times = [item.time for item in scenario.elastic.breaks]
    return min(times, default=None)


def judged(run: Any) -> np.ndarray:
    """The samples at which errors count, (n,) of bool.

    On a circle all, at poses the end of each dwell; never after a wire snapped.
    """
    time, tip = run.signals["time"], run.scenario.tip
    flags = np.ones(len(time), bool)
    if tip.poses:
        phase = np.mod(time + 1e-9, tip.dwell)
        flags = phase > tip.dwell - SETTLED
    snapped = break_time(run.scenario)
    return flags if snapped is None else flags & (time < snapped)


def errors(run: Any) -> tuple[np.ndarray, np.ndarray]:
    """Tip position [m] and tool axis [rad] against the reference, (n,) each."""
    tool, reference = run.snake.tool, run.tip.reference
    n_d = reference.n / np.linalg.norm(reference.n, axis=1)[:, None]
    sine = np.linalg.norm(np.cross(tool.n, n_d), axis=1)
    angle = np.arctan2(sine, (tool.n * n_d).sum(axis=1))
    return np.linalg.norm(tool.p - reference.p, axis=1), angle


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them."""
    time = run.signals["time"]
    flags = judged(run)
    position, angle = (error[flags] for error in errors(run))
    snapped = break_time(run.scenario)
    before = time < (np.inf if snapped is None else snapped)
    tension = run.wires.tension.T[before]
    alarm = float(run.watch.alarm.time[-1])
    lost = alarm >= 0.0 and float(run.watch.alarm.module[-1]) == 0.0
    false = not lost and alarm >= 0.0 and (snapped is None or alarm < snapped)
    found = alarm >= 0.0 and not (false or lost)
    some = len(position) > 0
    return {
        "max_pose_error": float(position.max()) if some else None,
        "rms_pose_error": float(np.sqrt(np.mean(position**2))) if some else None,
        "max_axis_error": float(angle.max()) if some else None,
        **_balls(run, alarm if lost else None),
        "min_tension": float(tension.min()),
        "max_tension": float(tension.max()),
        "break_detection_time": alarm - snapped if found and snapped else None,
        "false_alarms": int(false),
        "refused_poses": int(np.count_nonzero(np.diff(run.ik.status.code) > 0)),
    }


def _balls(run: Any, buckled: float | None) -> dict[str, Any]:
    """How far the balls of a module part, and whether the snake stayed."""
    if run.scenario.wires != "statics":
        return {"max_coupler_error": float(run.snake.coupler_error.angle.max())}
    gaps = run.snake.gaps
    return {
        "max_split": float(gaps.split.max()),
        "max_torsion": float(np.abs(gaps.torsion).max()),
        "least_eigenvalue": float(run.wires.stability.least_eigenvalue.min()),
        "buckled_at": buckled,
    }
