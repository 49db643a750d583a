"""The figures of the bypass and of the clearance constraint."""

from dataclasses import replace
from typing import Any

import numpy as np

from diagrams.common.run import simulate
from plants.surgeon.hunting_tool import Hunt

HAND_OVER = 0.02
"""The robot hands over while its tip is this near to S's tip; S may be touched [m]."""
_WITHDRAWN = 0.01
"""Depth of O's tip where it is out of everybody's way [m]."""


def time_without_obstacle(scenario: Any) -> float | None:
    """Time to the target of the same scenario with O withdrawn to its trocar [s]."""
    x, y, z = scenario.obstacle.p_WG
    withdrawn = replace(
        scenario.obstacle,
        times=[0.0],
        points=[[x, y, z - _WITHDRAWN]],
        recording=None,
        pushes=[],
    )
    twin = replace(
        scenario, obstacle=withdrawn, recording="", hunt=Hunt(), time_ratio=False
    )
    arrival: float | None = simulate(twin).metrics.get("time_to_target")
    return arrival


def bypass_figures(
    run: Any, arrival: float | None, tip_error: np.ndarray
) -> dict[str, Any]:
    """Figures of a run.

    Args:
        run: The run.
        arrival: Its time to the target [s], None if not reached.
        tip_error: Distance of R's tip from S's (n) [m].
    """
    time = run.signals["time"]
    status = run.matrix("planner.clearance")
    near = status[:, 1] > 0.5
    held = status[near, 2] > 0.5
    approach = tip_error > HAND_OVER
    to_target = run.matrix("clearance")[approach, 1]
    figures = {
        "evasion_condition_held": float(held.mean()) if near.any() else 1.0,
        "dodging_time": float(np.mean(status[:, 3]) * time[-1]),
        "target_touched_before_hand_over": bool((to_target <= 0.0).any()),
        "edge_switches": 0,
        "waiting_time": 0.0,
        "time_ratio": None,
    }
    if "planner.way.waiting" in run.signals:
        way = run.matrix("planner.way")
        figures["edge_switches"] = round(way[-1, 5])
        figures["waiting_time"] = float(np.mean(way[:, 1] > 0.0) * time[-1])
    if run.scenario.time_ratio and arrival:
        alone = time_without_obstacle(run.scenario)
        figures["time_ratio"] = arrival / alone if alone else None
    return figures
