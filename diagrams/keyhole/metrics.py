"""The figures of an operation through one trocar, all from true quantities."""

from typing import Any

import numpy as np

from diagrams.bedside.wrist_metrics import AFTER, most, rms
from diagrams.gauze.tools import OBSTACLE, in_the_way
from diagrams.resection.metrics import outside_depth
from plants.tissue.labels import CRITICAL
from systems.keyhole.phases import Phases, Reason

REASON = {reason.value: reason.text for reason in Reason}


def tool_errors(run: Any) -> np.ndarray:
    """Distance of the true tool from its reference, both in E, over time (n) in m."""
    errors: np.ndarray = np.linalg.norm(run.snake.tool.p - run.tip.reference.p, axis=1)
    return errors


def working(run: Any) -> np.ndarray:
    """Whether the tool is at its plan, over time (n,)."""
    code, snake = run.operation.phase.code, run.operation.snake
    clock = snake.clock
    at_plan = (np.round(code) == Phases.RESECT) & (snake.out >= 1.0) & (clock > 0.0)
    after = np.maximum.accumulate(np.where(at_plan, 0.0, 1.0) * run.signals["time"])
    settled: np.ndarray = at_plan & (run.signals["time"] - after > 1.0)
    return settled


def log_of_phases(run: Any) -> list[dict[str, Any]]:
    """Each phase that was entered: name, time in s, reason."""
    code, reason = run.operation.phase.code, run.operation.phase.reason
    time = run.signals["time"]
    first = np.flatnonzero(np.append(True, np.diff(code) != 0))
    return [
        {
            "phase": Phases(round(code[i])).name.lower(),
            "start": float(time[i]),
            "reason": REASON[round(reason[i])],
        }
        for i in first
    ]


def withdrawals(run: Any) -> list[float]:
    """How long the tool took to draw back, at each stop, in s."""
    time, code = run.signals["time"], np.round(run.operation.phase.code)
    retreat = run.operation.snake.retreat
    found = []
    for start in (
        np.flatnonzero((code[1:] == Phases.STOPPED) & (np.diff(code) != 0)) + 1
    ):
        drawn = np.flatnonzero(retreat[start:] >= 1.0 - 1e-9)
        if len(drawn):
            since = float(run.operation.phase.since[start])
            found.append(float(time[start + drawn[0]]) - since)
    return found


def share(flags: np.ndarray) -> float | None:
    """Of the time that something holds; None of no time."""
    return float(flags.mean()) if len(flags) else None


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them."""
    time, late = run.signals["time"], run.signals["time"] >= AFTER
    force = np.linalg.norm(run.wall.force.f, axis=1)
    off = run.wall.fulcrum_error.distance
    at_work = working(run)
    errors = tool_errors(run)[at_work]
    organ = np.linalg.norm(run.organ.estimate.p - run.organ.true.p, axis=1)
    phases = log_of_phases(run)
    gate = [one["start"] for one in phases if one["phase"] == "resect"]
    drawn = withdrawals(run)
    halted = np.round(run.operation.phase.code) == Phases.STOPPED
    figures: dict[str, Any] = {
        "rms_tool_error": rms(errors),
        "max_tool_error": most(errors),
        "time_at_work": float(at_work.mean() * time[-1]),
        "rms_lateral_force": rms(force[late]),
        "max_lateral_force_3s": most(force[late]),
        "max_lateral_force": float(force.max()),
        "rms_fulcrum_error": rms(off[late]),
        "max_fulcrum_error_3s": most(off[late]),
        "rms_organ_error": rms(organ[at_work]),
        "max_organ_error": most(organ[at_work]),
        "max_body_deviation": most(run.snake.deviation.distance[at_work]),
        "max_coupler_error": float(run.snake.coupler_error.angle.max()),
        "gate_opened": gate[0] if gate else None,
        "withdrawal_time": max(drawn) if drawn else None,
        "max_stray": most(tool_errors(run)[halted]),
        "ik_refused": share(run.ik.status.code[at_work] != 0),
        "drums_limited": share(run.drums.limited.code[at_work] != 0),
        "estimates_refused": int(run.wrist.fulcrum.refused[-1]),
        "jumps_followed": int(run.wrist.fulcrum.jumps[-1]),
        "stops": [one for one in phases if one["phase"] == "stopped"],
        "phases": phases,
    }
    if run.scenario.others:
        tools = in_the_way(run.scenario.theatre.tools)
        moving = [role == OBSTACLE for _, role in tools]
        gaps = run.clearance.distance[:, moving]
        figures["min_tool_clearance"] = float(gaps.min())
    if run.case.resection is not None:
        figures |= resected(run)
    return figures


def resected(run: Any) -> dict[str, Any]:
    """The tissue's share of the figures."""
    session, reach = run.case.session, run.case.resection.reach
    station = run.diagram.GetSubsystemByName("station")
    volume = station.GetSubsystemByName("tissue_carver").carving.volume
    removed, touched = run.tissue.removed, run.tissue.touched
    nearest = float(touched.critical_distance[-1])
    return {
        "tumour_volume": session.volume.tumour_volume,
        "resected_fraction": float(removed.tumour[-1]) / session.volume.tumour_volume,
        "planned_fraction": session.fraction,
        "reachable_fraction": reach.fraction if reach else None,
        "healthy_removed": float(removed.healthy[-1]),
        "max_outside_depth": outside_depth(volume),
        "body_collisions": int(touched.hits[-1]),
        "min_critical_distance": nearest if nearest >= 0.0 else None,
        "critical_touched": bool((volume.labels == CRITICAL).any() and nearest <= 0.0),
    }
