"""The figures of the bypass and of the clearance constraint."""

from typing import Any

import numpy as np

from diagrams.gauze.scenario import WITHOUT_OBSTACLE
from diagrams.gauze.tools import OBSTACLE, gap

HAND_OVER = 0.02
"""The robot hands over while its tip is this near to S's tip; S may be touched [m]."""


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
    status = run.planner.clearance
    near, held = status.near > 0.5, status.condition > 0.5
    scenario, lost = run.case.scenario, np.zeros(len(time), bool)
    for tool in scenario.of_role(OBSTACLE):
        lost |= run.signals[f"{tool.name}.estimate.known"] < 0.5
    if lost.any():  # how fast a hand comes that the tracker has lost nobody knows
        constraint = scenario.clearance_constraint
        close = gap(run, OBSTACLE) < constraint.obstacle_speed / constraint.rate
        near, held = near | (lost & close), held & ~lost
    held = held[near]
    approach = tip_error > HAND_OVER
    to_target = gap(run, "target")[approach]
    figures = {
        "evasion_condition_held": float(held.mean()) if near.any() else 1.0,
        "dodging_time": float(np.mean(status.dodge) * time[-1]),
        "target_touched_before_hand_over": bool((to_target <= 0.0).any()),
        "edge_switches": 0,
        "waiting_time": 0.0,
        "time_ratio": None,
    }
    if "planner.way" in run.logged:
        way = run.planner.way
        figures["edge_switches"] = round(way.switches[-1])
        figures["waiting_time"] = float(np.mean(way.waiting > 0.0) * time[-1])
    if WITHOUT_OBSTACLE in run.case.companions and arrival:
        alone = run.case.companions[WITHOUT_OBSTACLE].metrics.get("time_to_target")
        figures["time_ratio"] = arrival / alone if alone else None
    return figures
