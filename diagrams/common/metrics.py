"""Figures that every run has."""

import statistics
from typing import Any

WALL_CLOCK = frozenset(
    ("real_time_factor", "planner_step_median")  # of any run
    + ("planning_time", "reach_time", "access_time")  # of a resection
)
"""Keys that depend on the machine: exempt from "same seed, same result"."""


def common(run: Any) -> dict[str, Any]:
    """The figures of any run: what ran, how fast, and whether it ended early."""
    figures: dict[str, Any] = {
        "system": run.scenario.system,
        "seed": run.scenario.seed,
        "duration": run.simulated,
        "real_time_factor": run.simulated / max(run.wall_time, 1e-9),
    }
    if run.instants:
        figures["planner_step_median"] = statistics.median(run.instants)
    if run.error:
        figures["error"] = run.error
    return figures
