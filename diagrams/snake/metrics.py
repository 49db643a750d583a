"""The figures of a moving snake."""

from typing import Any

import numpy as np

from diagrams.snake.robot import ball_figures, is_free
from systems.resection.wires.tip_reference import turned

SETTLED = 0.3
"""Errors at a pose count over the last so many seconds of its dwell."""

UNFELT = 0.02
"""Force in N below which a contact that is told counts as none."""


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
        **_balls(run),
        **_interval(run),
        **_felt(run),
        "min_tension": float(tension.min()),
        "max_tension": float(tension.max()),
        "break_detection_time": alarm - snapped if found and snapped else None,
        "false_alarms": int(false),
        "refused_poses": int(np.count_nonzero(np.diff(run.ik.status.code) > 0)),
    }


def _balls(run: Any) -> dict[str, Any]:
    """How far the balls of a module part, and whether the snake stayed."""
    if not is_free(run.scenario):
        return {"max_coupler_error": float(run.snake.coupler_error.angle.max())}
    error, _ = errors(run)
    return {
        "rms_tool_error": float(np.sqrt(np.mean(error**2))),
        "max_tool_error": float(error.max()),
        **ball_figures(run),
        "loop_width": loop_width(run),
    }


def _interval(run: Any) -> dict[str, Any]:
    """How good the bounds of the tensions at the tips are."""
    if not run.scenario.estimate:
        return {}
    tip, found = run.wires.tip_tension.T, run.wires.interval
    inside = (found.lower - 1e-4 <= tip) & (tip <= found.upper + 1e-4)
    return {
        "tension_inside": float(inside.mean()),
        "tension_width": float(np.median(found.upper - found.lower)),
    }


def _felt(run: Any) -> dict[str, Any]:
    """When a contact was told, and how often there was none."""
    figures: dict[str, Any] = {}
    if run.scenario.control_pretension:
        figures["cell_code"] = int(run.cells.code.code[-1])
    if run.scenario.feel:
        told = run.base.contact.flag != 0.0
        force = np.linalg.norm(run.tool.force.f, axis=1)
        began = told & ~np.append(False, told[:-1])
        figures["contact_at"] = (
            float(run.signals["time"][told.argmax()]) if told.any() else None
        )
        figures["false_contacts"] = int((began & (force < UNFELT)).sum())
    return figures


def swings(run: Any) -> np.ndarray:
    """The tool in the last whole swing, there and back, (n, 2, 3) in m.

    Each row has it twice at the same bend asked for: on the way to the one side, and
    on the way back. Without a whole swing there are none.
    """
    time, tip, tool = run.signals["time"], run.scenario.tip, run.snake.tool.p
    turns = np.array([turned(tip.circle, t) for t in time]) / (2 * np.pi)
    last = np.floor(turns[-1] - 1.25)  # from one end back at 1/4, there until 5/4
    if tip.way != "swing" or tip.poses or last < 0:
        return np.empty((0, 2, 3))
    quarter = np.linspace(-0.25, 0.25, 201)
    there, back = last + 1.0 + quarter, last + 0.5 - quarter

    def at(turn: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(turn, turns, column) for column in tool.T])

    return np.stack([at(there), at(back)], axis=1)


def loop_width(run: Any) -> float | None:
    """How far apart the tool is there and back at most, in m; None without a swing."""
    pairs = swings(run)
    if not len(pairs):
        return None
    return float(np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1).max())
