"""The resection as a study: what is logged, measured, plotted and shown."""

from pydrake.systems.analysis import SimulatorConfig

from diagrams.common.study import Study, View
from diagrams.resection.resection_diagram import make_resection_diagram
from diagrams.resection.resection_metrics import measure
from diagrams.resection.resection_plots import plots
from diagrams.resection.resection_replay import decorate
from diagrams.resection.resection_scenario import (
    LOG_PERIOD,
    ResectionScenario,
    check,
    length,
)

XYZ = ("x", "y", "z")
TOOL = (*XYZ, "n_x", "n_y", "n_z")
SIGNALS = {
    "tip.reference": TOOL,
    "plan.progress": ("index",),
    "snake.tool": TOOL,
    "snake.posture": ("s", "alpha1", "beta1", "alpha2", "beta2", "alpha3", "beta3"),
    "ik.status": ("code",),
    "drums.limited": ("code",),
    "tissue.index": ("index",),
    "tissue.removed": ("tumour", "healthy"),
    "tissue.touched": ("hits", "critical_distance"),
    "watch.alarm": ("time", "module"),
}


def integrator(scenario: ResectionScenario) -> SimulatorConfig:
    """CENIC with one step a command."""
    return SimulatorConfig(
        integration_scheme="cenic", accuracy=1e-3, max_step_size=scenario.period
    )


STUDY = Study(
    name="resection",
    scenario=ResectionScenario,
    make_diagram=make_resection_diagram,
    check=check,
    measure=measure,
    signals=SIGNALS,
    log_period=LOG_PERIOD,
    plots=plots,
    decorate=decorate,
    controller="resection_ik",
    integrator=integrator,
    view=View(camera=(0.055, -0.075, 0.035), target=(0.0, 0.0, 0.014)),
    frame_rate=10.0,
    length=length,
    replay_length=45.0,
)
"""The resection of a tumour."""
