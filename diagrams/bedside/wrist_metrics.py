"""The figures of the passive wrist, all from true quantities."""

from typing import Any

import numpy as np

CONVERGED = 1e-3
"""The fulcrum is found when the estimate is this close to stay [m]."""
AFTER = 3.0
"""Figures of force and fulcrum that end in `_3s` begin here [s]."""
CHI2_95 = 7.815
"""95 % point of the normalised squared error of a 3-D estimate."""


def settled(time: np.ndarray, value: np.ndarray, bound: float) -> float | None:
    """How long after the first sample a value stays within a bound; None if never."""
    over = np.flatnonzero(value > bound)
    if not len(over):
        return 0.0
    last = int(over[-1])
    if last + 1 >= len(time):
        return None
    return float(time[last + 1] - time[0])


def estimate_errors(run: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Estimate minus true fulcrum: 3-D, across, along, and normalised squared."""
    error = run.wrist.fulcrum.p - run.wall.fulcrum.p
    u = run.wrist.shaft.u
    along = np.einsum("ni,ni->n", error, u)
    across = error - along[:, None] * u
    C = run.wrist.covariance.P.reshape(-1, 3, 3) + 1e-14 * np.eye(3)
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
    size, side = np.linalg.norm(error, axis=1), np.linalg.norm(across, axis=1)
    return size, side, np.abs(along), squared


def wrist_figures(run: Any, start: float, event: float = -1.0) -> dict[str, Any]:
    """The wrist's share of `metrics.json`.

    Args:
        run: A run whose log holds `WRIST_SIGNALS`.
        start: Figures of force and error start here [s]; times count from zero.
        event: Time of the wall's jump [s]; negative for none.
    """
    time = run.signals["time"]
    force = np.linalg.norm(run.wall.force.f, axis=1)
    off = run.wall.fulcrum_error.distance
    spatial, across, along, squared = estimate_errors(run)
    late = time >= start - 1e-9
    wrist = run.scenario.passive_wrist
    scale = run.wrist.permission.speed_scale
    code = np.round(run.wrist.permission.code)
    figures: dict[str, Any] = {
        "wrist": run.scenario.wrist,
        "rms_lateral_force": rms(force[late]),
        "max_lateral_force": float(force[late].max(initial=0.0)),
        "max_lateral_force_ever": float(force.max()),
        "time_over_warning": float(np.mean(force > wrist.warning_force) * time[-1]),
        "time_over_limit": float(np.mean(force > wrist.force_limit) * time[-1]),
        "rms_fulcrum_error": rms(off[late]),
        "max_fulcrum_error": float(off[late].max(initial=0.0)),
        "rms_estimate_error": rms(spatial[late]),
        "rms_lateral_estimate_error": rms(across[late]),
        "rms_depth_estimate_error": rms(along[late]),
        "fulcrum_convergence_time": settled(time, spatial, CONVERGED),
        "lateral_convergence_time": settled(time, across, CONVERGED),
        "depth_convergence_time": settled(time, along, CONVERGED),
        "probe_peak_force": float(force[~late].max(initial=0.0)),
        "fulcrum_error_3s": float(np.interp(start + 3.0, time, spatial)),
        "nees_above_95": float(np.mean(squared[time > 15.0] > CHI2_95))
        if time[-1] > 16.0
        else None,
        "stiffness_estimate": float(run.wrist.fulcrum.stiffness[-1]),
        "breathing_rate_estimate": float(run.wrist.fulcrum.rate[-1]),
        "jumps_followed": int(run.wrist.fulcrum.jumps[-1]),
        "estimates_refused": int(run.wrist.fulcrum.refused[-1]),
        "time_frozen": float(np.mean((code == 8) | (code == 9)) * time[-1]),
        "time_inaccurate": float(np.mean(run.wrist.accuracy.accurate < 0.5) * time[-1]),
        "accuracy_alarms": int(run.wrist.accuracy.alarms[-1]),
        "mean_speed_scale": float(scale[late].mean()) if late.any() else None,
    }
    if "wrist.tip_force" in run.logged:
        figures["rms_tip_force_error"] = tip_force_error(run)
    if "robot.shaft" in run.logged:
        figures |= bend_figures(run, late)
    if event >= 0.0:
        after = time >= event
        clock, load = time[after] - event, force[after]
        figures["time_to_2N"] = last_above(clock, load, 2.0)
        figures["time_to_02N"] = last_above(clock, load, 0.2)
    return figures


def true_tip(run: Any) -> np.ndarray:
    """Of the robot's tool, (n, 3): as the joints have it, if the shaft is rigid."""
    tip: np.ndarray = (
        run.robot.shaft.tip if "robot.shaft" in run.logged else run.robot.tool.tip
    )
    return tip


def bend_figures(run: Any, late: np.ndarray) -> dict[str, Any]:
    """How far the bend carries the tip, and how much of it is not reckoned."""
    shaft, true = run.wrist.shaft, run.robot.shaft.tip
    straight = shaft.p + run.scenario.instrument.length * shaft.u
    way = np.linalg.norm(true - straight, axis=1)[late]
    left = np.linalg.norm(true - run.robot.tool.tip, axis=1)[late]
    return {"rms_bend": rms(way), "max_bend": most(way), "rms_bend_error": rms(left)}


def tip_force_error(run: Any) -> float | None:
    """Of the side force at the tip that is told, against the one that pushes [N]."""
    u = run.wrist.shaft.u
    true = np.array([run.scenario.tip_push.at(t) for t in run.signals["time"]])
    true -= np.einsum("ni,ni->n", true, u)[:, None] * u
    return rms(np.linalg.norm(run.wrist.tip_force.f - true, axis=1))


def rms(values: np.ndarray) -> float | None:
    """Root of the mean square; None of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def most(values: np.ndarray) -> float | None:
    """The greatest; None of nothing."""
    return float(values.max()) if len(values) else None


def last_above(time: np.ndarray, value: np.ndarray, bound: float) -> float | None:
    """When a value falls below a bound to stay; None if it never does."""
    return settled(np.append(0.0, time), np.append(bound, value), bound)
