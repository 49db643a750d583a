"""An imperfect bedside, swept: force, fulcrum, tip and clearance until it fails.

Each row is a run of `pwe_arc` or `gauze_blocked` with one imperfection, with what is
there for it switched on and off. `python -m tests.benchmarks.bedside_sweep` draws
`diagrams/bedside/sweeps.png` as well.
"""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.common.run import simulate
from diagrams.studies import load_scenario

PICTURE = Path(__file__).parents[2] / "diagrams" / "bedside" / "sweeps.png"
SHORT = {"pwe_arc": ["duration=12"], "gauze_blocked": ["time_ratio=false"]}
SWEEPS: dict[str, tuple[str, str, str, list[float], str]] = {
    "turning stiffness [N m/rad]": (
        "pwe_arc",
        "abdomen.turning_stiffness={}",
        "tip_load.active",
        [0.0, 0.3, 0.5, 1.0, 2.0, 4.0],
        "off fulcrum [mm rms]",
    ),
    "side force at the tip [N]": (
        "pwe_arc",
        "tip_push={{force: [{}, 0, 0], start: 4.0, duration: 4.0}}",
        "tip_load.active",
        [0.0, 0.5, 1.0, 2.0, 4.0],
        "off fulcrum [mm rms]",
    ),
    "registration off by [mm]": (
        "gauze_blocked",
        "tracker.shift=[{}e-3, 0, 0]",
        "registration.active",
        [0.0, 1.0, 2.0, 3.0, 4.0, 8.0],
        "clearance [mm]",
    ),
}
"""Scenario, its key, what is there for it, the values, and what is drawn."""


def figures(run: Any) -> dict[str, float]:
    """What a run is judged by: mm and N, from 3 s on."""
    late = run.signals["time"] >= 3.0
    force = np.linalg.norm(run.wall.force.f, axis=1)[late]
    off = 1e3 * run.wall.fulcrum_error.distance[late]
    told = run.metrics
    return {
        "N rms": float(np.sqrt(np.mean(force**2))),
        "N most": float(force.max()),
        "off fulcrum [mm rms]": float(np.sqrt(np.mean(off**2))),
        "clearance [mm]": 1e3 * told.get("min_tool_clearance", np.nan),
        "tip [mm]": 1e3 * told.get("final_tip_error", np.nan),
    }


def swept(title: str, seed: int) -> dict[bool, list[dict[str, float]]]:
    """The figures of a sweep, with what is there for it switched on and off."""
    name, key, switch, values, _ = SWEEPS[title]
    found: dict[bool, list[dict[str, float]]] = {False: [], True: []}
    for on in found:
        for value in values:
            more = [key.format(value), f"{switch}={str(on).lower()}", f"seed={seed}"]
            found[on].append(figures(simulate(load_scenario(name, SHORT[name] + more))))
    return found


def table(title: str, found: dict[bool, list[dict[str, float]]]) -> str:
    """A sweep as text."""
    _, _, switch, values, _ = SWEEPS[title]
    lines = [f"{title}"]
    for on, rows in found.items():
        for value, row in zip(values, rows, strict=True):
            numbers = "  ".join(f"{k} {x:.3f}" for k, x in row.items() if x == x)
            lines.append(f"  {switch}={on!s:5} {value:5.1f}: {numbers}")
    return "\n".join(lines)


def draw(all_found: dict[str, dict[bool, list[dict[str, float]]]]) -> Figure:
    """A plot of each sweep."""
    figure = new_figure(9.0, 2.8)
    for k, (title, found) in enumerate(all_found.items(), 1):
        *_, values, what = SWEEPS[title]
        axes = add_axes(figure, 1, len(all_found), k)
        for on, rows in found.items():
            color = COLORS["robot"] if on else COLORS["obstacle"]
            label = SWEEPS[title][2] if on else "without"
            axes.plot(values, [r[what] for r in rows], "o-", color=color, label=label)
        axes.axhline(2.0 if "clear" in what else 1.0, color="k", lw=0.6, ls="--")
        axes.set_xlabel(title)
        axes.set_ylabel(what)
        axes.legend(fontsize=7)
    return figure


def report(seed: int, scenes: int) -> str:
    """The tables, as text; one run a value, whatever `scenes` is."""
    return "\n".join(table(title, swept(title, seed)) for title in SWEEPS)


def main() -> None:
    """Prints the tables and draws the picture."""
    found = {title: swept(title, 1) for title in SWEEPS}
    for title, rows in found.items():
        print(table(title, rows))
    draw(found).savefig(PICTURE, dpi=100)


if __name__ == "__main__":
    main()
