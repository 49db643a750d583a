"""Two runs beside each other: their figures, and the signals that differ most."""

import json
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.figures import in_words
from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.common.scenario import ScenarioError

_SHOWN = 6
"""Signals that are drawn."""


def read(folder: Path) -> tuple[dict[str, Any], np.ndarray]:
    """Figures and signals of a run, the signals as columns with names.

    Raises:
        ScenarioError: If the folder holds no results.
    """
    try:
        figures = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        signals = np.genfromtxt(
            folder / "signals.csv", delimiter=",", names=True, deletechars=""
        )
    except (OSError, ValueError) as error:
        raise ScenarioError(
            f"{str(folder)!r} holds no results of a run: {error}"
        ) from error
    return figures, signals


def table(one: dict[str, Any], other: dict[str, Any], names: tuple[str, str]) -> str:
    """Figures side by side, a star at those that differ."""
    lines = [("", *names, "")]
    for key in one | other:
        a, b = (in_words(key, f[key]) if key in f else "" for f in (one, other))
        lines.append((key, a[:40], b[:40], "" if a == b else "*"))
    widths = [max(len(line[k]) for line in lines) for k in range(3)]
    return "\n".join(
        f"  {key:<{widths[0]}}  {a:<{widths[1]}}  {b:<{widths[2]}}  {mark}".rstrip()
        for key, a, b, mark in lines
    )


def most_different(one: np.ndarray, other: np.ndarray) -> list[str]:
    """Signals of both that differ, against their own size; the most different first."""
    first, second = (run.dtype.names or () for run in (one, other))
    score = {}
    for name in set(first) & set(second) - {"time"}:
        again = np.interp(one["time"], other["time"], other[name])
        size = np.ptp(one[name]) + np.ptp(other[name])
        if size > 0.0:
            score[name] = float(np.sqrt(np.mean((one[name] - again) ** 2)) / size)
    order = sorted(score, key=lambda name: (-score[name], name))
    return [name for name in order if score[name] > 0.0]


def overlay(one: np.ndarray, other: np.ndarray, names: tuple[str, str]) -> Figure:
    """The signals that differ most, over each other."""
    shown = most_different(one, other)[:_SHOWN]
    figure = new_figure(7.0, 1.2 + 1.6 * max(1, len(shown)))
    for place, name in enumerate(shown, 1):
        axes = add_axes(figure, len(shown), 1, place)
        for run, label, colour in zip(
            (one, other), names, ("robot", "obstacle"), strict=True
        ):
            axes.plot(run["time"], run[name], color=COLORS[colour], label=label)
        axes.set_title(name, fontsize=8, loc="left")
        if place == 1:
            axes.legend(ncols=2, loc="upper right")
    if shown:
        axes.set_xlabel("time [s]")
    else:
        figure.text(0.5, 0.5, "no signal differs", ha="center")
    return figure
