"""Plots of a wrist study: Figure 3 as curves, with and without the emulation."""

from typing import Any

from matplotlib.figure import Figure

from diagrams.bedside.wrist_plots import estimate, forces


def plots(run: Any) -> dict[str, Figure]:
    """All plots of a run, by file name."""
    scenario = run.scenario
    runs = {scenario.wrist: run, **run.case.companions}
    return {
        "forces": forces(runs, scenario.measure_from),
        "estimate": estimate(run, scenario.measure_from),
    }
