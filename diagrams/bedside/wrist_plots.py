"""Plots of the passive wrist: force, fulcrum, and what the estimator believes."""

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.bedside.wrist_metrics import estimate_errors
from diagrams.common.plots import COLORS, add_axes, new_figure

MM = 1e3
MODES = {
    "pwe": ("estimated fulcrum (pwe)", COLORS["robot"]),
    "known": ("told the fulcrum (known)", COLORS["target"]),
    "spring": ("fixed spring (spring)", COLORS["accent"]),
    "off": ("first guess for ever (off)", COLORS["obstacle"]),
}
"""How the modes are called and drawn."""


def forces(runs: Mapping[str, Any], start: float) -> Figure:
    """True lateral force and how far the shaft is off the true fulcrum.

    Args:
        runs: Mode to run, the one that counts first.
        start: Figures start here [s]; drawn as a line.
    """
    figure = new_figure(7.0, 5.0)
    upper, lower = add_axes(figure, 2, 1, 1), add_axes(figure, 2, 1, 2)
    drawn = 1e-3  # a logarithmic axis has no zero
    for order, (mode, run) in enumerate(runs.items()):
        name, color = MODES[mode]
        time = run.signals["time"]
        force = np.linalg.norm(run.wall.force.f, axis=1)
        style = {"color": color, "lw": 1.6 if not order else 1.0, "zorder": 5 - order}
        rms = np.sqrt(np.mean(force[time >= start] ** 2))
        label = f"{name}: {rms:.2g} N rms"
        upper.semilogy(time, np.maximum(force, drawn), label=label, **style)
        off = run.wall.fulcrum_error.distance * MM
        lower.semilogy(time, np.maximum(off, drawn), **style)
    limits = next(iter(runs.values())).scenario.passive_wrist
    for bound, name in (
        (limits.force_limit, "force limit"),
        (limits.warning_force, "warning"),
    ):
        upper.axhline(bound, color="k", lw=0.6, ls="--")
        upper.text(time[-1], 1.06 * bound, name, fontsize=7, ha="right")
    for axes in (upper, lower):
        axes.axvline(start, color=COLORS["muted"], lw=0.8, ls=":")
        axes.set_xlim(0.0, time[-1])
    top = max(20.0, upper.get_ylim()[1])
    upper.set(ylabel="lateral force [N]", ylim=(3e-3, top))
    lower.set(xlabel="time [s]", ylabel="shaft off fulcrum [mm]", ylim=(3e-3, None))
    upper.legend(
        frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8
    )
    return figure


def estimate(run: Any, start: float) -> Figure:
    """True and estimated fulcrum, the error with its sigma, stiffness and rate."""
    figure = new_figure(7.0, 7.6)
    time = run.signals["time"]
    believed, true = run.wrist.fulcrum.p, run.wall.fulcrum.p
    places = [add_axes(figure, 4, 1, row) for row in (1, 2, 3, 4)]
    colors = (COLORS["obstacle"], COLORS["target"], COLORS["robot"])
    for axis, color in enumerate(colors):
        name = "xyz"[axis]
        places[0].plot(time, true[:, axis] * MM, color=color, lw=2.4, alpha=0.35)
        places[0].plot(time, believed[:, axis] * MM, color=color, lw=1.0, label=name)
    span = np.ptp(true) * MM + 4.0
    middle = true.mean() * MM
    places[0].set(ylabel="fulcrum [mm]", ylim=(middle - span, middle + span))
    places[0].legend(
        frameon=False,
        ncols=3,
        title="wide: true, thin: estimated",
        title_fontsize=8,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
    )
    spatial, across, *_ = estimate_errors(run)
    sigma_across = run.wrist.fulcrum.sigma_across * MM
    sigma_along = run.wrist.fulcrum.sigma_along * MM
    places[1].semilogy(time, spatial * MM, color=COLORS["robot"], label="3-D error")
    places[1].semilogy(
        time,
        sigma_along,
        color=COLORS["robot"],
        ls="--",
        lw=0.8,
        label="sigma along",
    )
    places[1].semilogy(time, across * MM, color=COLORS["accent"], label="across")
    places[1].semilogy(
        time,
        sigma_across,
        color=COLORS["accent"],
        ls="--",
        lw=0.8,
        label="sigma across",
    )
    places[1].axhline(1.0, color="k", lw=0.6, ls=":")
    places[1].set(ylabel="error [mm]", ylim=(3e-3, 60.0))
    places[1].legend(frameon=False, ncols=4, fontsize=7, loc="upper right")
    motion, settings = run.scenario.wall_motion, run.scenario
    stiffness = [settings.abdomen.stiffness * motion.stiffness_factor(t) for t in time]
    places[2].semilogy(time, stiffness, color=COLORS["muted"], lw=2.4, label="true")
    places[2].semilogy(
        time,
        run.wrist.fulcrum.stiffness,
        color=COLORS["robot"],
        label="believed",
    )
    places[2].set(ylabel="stiffness [N/m]", ylim=(80.0, 4e3))
    places[2].legend(frameon=False, ncols=2, loc="upper right")
    if any(motion.breathing):
        places[3].axhline(motion.rate, color=COLORS["muted"], lw=2.4)
    places[3].plot(time, run.wrist.fulcrum.rate, color=COLORS["robot"])
    places[3].plot(
        time,
        0.4 * run.wrist.permission.speed_scale,
        color=COLORS["target"],
        lw=0.8,
        label="speed scale (1 at the top)",
    )
    places[3].legend(frameon=False, loc="lower right", fontsize=8)
    places[3].set(ylabel="breathing [Hz]", xlabel="time [s]", ylim=(-0.01, 0.42))
    for axes in places:
        axes.set_xlim(0.0, time[-1])
        axes.axvline(start, color=COLORS["muted"], lw=0.8, ls=":")
    return figure
