"""Figures that every run has, and the table they are printed in."""

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


def show(value: Any) -> str:
    """One figure as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(f"{key} {show(item)}" for key, item in value.items())
    if isinstance(value, list):
        return "; ".join(show(item) for item in value) if value else "none"
    return str(value)


def table(figures: dict[str, Any]) -> str:
    """The figures as a table of two columns, lists one line an item."""
    width = max(len(key) for key in figures)
    lines = []
    for key, value in figures.items():
        items = value if isinstance(value, list) and value else [value]
        for index, item in enumerate(items):
            lines.append(f"  {'' if index else key:<{width}}  {show(item)}")
    return "\n".join(lines)
