"""Plots of a wrist study: Figure 3 as curves, with and without the emulation."""

from dataclasses import replace
from typing import Any

from matplotlib.figure import Figure

from diagrams.bedside.wrist_plots import estimate, forces

UNLIMITED = 50.0
"""Force limit in N of the comparisons that cannot relax the wall: the highest."""


def compared(scenario: Any) -> dict[str, Any]:
    """The scenario in the other modes that it names, without a force limit.

    A wrist that cannot relax the wall would stand still for ever.
    """
    from diagrams.common.run import simulate

    runs = {}
    for mode in scenario.compare:
        wrist = replace(scenario.passive_wrist, force_limit=UNLIMITED)
        other = replace(scenario, wrist=mode, compare=[], passive_wrist=wrist)
        runs[mode] = simulate(other)
    return runs


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    scenario = run.scenario
    runs = {scenario.wrist: run, **compared(scenario)}
    return {
        "forces": forces(runs, scenario.measure_from),
        "estimate": estimate(run, scenario.measure_from),
    }
