"""An imperfect bedside, swept: force, fulcrum, tip and clearance until it fails.

Each point is three runs with one imperfection, seeds from `seed` on, with and without
what is there for it. `python -m tests.benchmarks.bedside_sweep` draws
`diagrams/bedside/sweeps.png` as well.
"""

from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.common.run import simulate
from diagrams.studies import load_scenario

PICTURE = Path(__file__).parents[2] / "diagrams" / "bedside" / "sweeps.png"
SEEDS = 3
OFF, FORCE, TIP = "off fulcrum [mm rms]", "force [N rms]", "tip told wrong [mm rms]"
CLEAR = "clearance [mm]"
ASKED = {OFF: 1.0, FORCE: 0.3, TIP: 1.0, CLEAR: 2.0}
"""What is asked; clearance is to be more, all else less."""

type Rows = list[dict[str, np.ndarray]]
type Found = dict[str, Rows]


class Sweep(NamedTuple):
    """A scenario, one key of it, its values, and what is drawn of the runs."""

    scenario: str
    sets: list[str]
    curves: dict[str, list[str]]
    """Overrides by label; {} stands for the value."""
    values: list[float]
    drawn: str


def switched(key: str, more: str) -> dict[str, list[str]]:
    """Without and with what is there for it."""
    return {"without": [more], key: [more, f"{key}=true"]}


ARC = ["duration=12", "compare=[]"]
PUSH = "tip_push={{force: [{}, 0, 0], start: 4.0, duration: 4.0}}"
BENT = "instrument.bending_stiffness={}"
TAP = "tip_push={force: [1, 0, 0], start: 6.0, duration: 1.0}"
SLOW = "abdomen.tissue.slow_stiffness={}"
SWEEPS = {
    "turning stiffness [N m/rad]": Sweep(
        "pwe_arc",
        ARC,
        switched("tip_load.active", "abdomen.turning_stiffness={}"),
        [0.0, 0.3, 0.5, 1.0, 2.0, 4.0],
        OFF,
    ),
    "side force at the tip [N]": Sweep(
        "pwe_arc",
        ARC,
        switched("tip_load.active", PUSH),
        [0.0, 0.5, 1.0, 2.0, 4.0],
        OFF,
    ),
    "tissue beside K=500 [N/m], breathing": Sweep(
        "pwe_arc_breathing",
        ["duration=12", "compare=[]"],
        {
            "k_s, 0.5 s": [SLOW, "abdomen.tissue.slow_time=0.5"],
            "k_s, 5 s": [SLOW, "abdomen.tissue.slow_time=5"],
            "grain k_g": ["abdomen.tissue.grain_stiffness={}"],
        },
        [0.0, 500.0, 2000.0],
        OFF,
    ),
    "registration off by [mm]": Sweep(
        "gauze_blocked",
        ["time_ratio=false"],
        switched("registration.active", "tracker.shift=[{}e-3, 0, 0]"),
        [0.0, 2.0, 8.0],
        CLEAR,
    ),
    "EI of the shaft [N m2]": Sweep(
        "pwe_arc",
        ARC,
        switched("shaft_bend.active", BENT),
        [2.0, 3.5, 5.3, 10.0, 20.0],
        OFF,
    ),
    "EI, 1 N at the tip for 1 s [N m2]": Sweep(
        "pwe_arc",
        [*ARC, TAP, "tip_load.active=true"],
        switched("shaft_bend.active", BENT),
        [2.0, 5.3, 20.0],
        TIP,
    ),
}


def figures(run: Any) -> dict[str, float]:
    """What a run is judged by: mm and N, from 3 s on."""
    late = run.signals["time"] >= 3.0
    force = np.linalg.norm(run.wall.force.f, axis=1)[late]
    off = 1e3 * run.wall.fulcrum_error.distance[late]
    told = run.metrics
    return {
        OFF: float(np.sqrt(np.mean(off**2))),
        FORCE: float(np.sqrt(np.mean(force**2))),
        "N most": float(force.max()),
        CLEAR: 1e3 * told.get("min_tool_clearance", np.nan),
        TIP: 1e3 * told.get("rms_bend_error", np.nan),
        "bend [mm rms]": 1e3 * told.get("rms_bend", np.nan),
    }


def swept(title: str, seed: int) -> Found:
    """The figures of a sweep: by curve a row a value, of each figure all seeds'."""
    sweep = SWEEPS[title]
    found: Found = {label: [] for label in sweep.curves}
    for label, sets in sweep.curves.items():
        for value in sweep.values:
            more = [*sweep.sets, *(text.format(value) for text in sets)]
            runs = [
                figures(simulate(load_scenario(sweep.scenario, [*more, f"seed={s}"])))
                for s in range(seed, seed + SEEDS)
            ]
            found[label].append({k: np.array([r[k] for r in runs]) for k in runs[0]})
    return found


def fails(what: str, values: np.ndarray) -> bool:
    """Whether the worst of the seeds is not what is asked."""
    if what == CLEAR:
        return bool(values.min() < ASKED[what])
    return bool(values.max() > ASKED[what])


def failing(title: str, rows: Rows) -> list[float]:
    """The values of a sweep at which a seed fails."""
    sweep = SWEEPS[title]
    asked = (sweep.drawn, FORCE)
    pairs = zip(sweep.values, rows, strict=True)
    return [v for v, row in pairs if any(fails(w, row[w]) for w in asked)]


def table(title: str, found: Found) -> str:
    """A sweep as text: median (least-most) of the seeds."""
    lines = [title]
    for label, rows in found.items():
        for value, row in zip(SWEEPS[title].values, rows, strict=True):
            numbers = "  ".join(
                f"{k} {np.median(x):.3f} ({x.min():.3f}-{x.max():.3f})"
                for k, x in row.items()
                if np.isfinite(x).all()
            )
            lines.append(f"  {label:20} {value:6.1f}: {numbers}")
        lines.append(f"  {label:20} fails at: {failing(title, rows) or 'none'}")
    return "\n".join(lines)


def draw(all_found: dict[str, Found]) -> Figure:
    """Two plots of each sweep, median and range of the seeds; crosses fail."""
    colors = [COLORS["obstacle"], COLORS["robot"], COLORS["target"]]
    figure = new_figure(10.0, 11.0)
    for k, (title, found) in enumerate(all_found.items()):
        sweep = SWEEPS[title]
        for row, what in enumerate((sweep.drawn, FORCE)):
            axes = add_axes(figure, 4, 3, 1 + k % 3 + 3 * (2 * (k // 3) + row))
            for (label, rows), color in zip(found.items(), colors, strict=False):
                y = np.array([r[what] for r in rows])
                x, middle = np.array(sweep.values), np.median(y, axis=1)
                axes.plot(x, middle, "o-", color=color, label=label, ms=4)
                axes.fill_between(x, y.min(1), y.max(1), color=color, alpha=0.2)
                bad = np.array([fails(what, values) for values in y])
                axes.plot(x[bad], middle[bad], "x", color="k", ms=9)
            axes.axhline(ASKED[what], color="k", lw=0.6, ls="--")
            axes.set_xlabel(title)
            axes.set_ylabel(what)
            axes.legend(fontsize=7)
    return figure


def report(seed: int, scenes: int) -> str:
    """The tables, as text; `SEEDS` runs a value, whatever `scenes` is."""
    return "\n".join(table(title, swept(title, seed)) for title in SWEEPS)


def main() -> None:
    """Prints the tables and draws the picture."""
    found = {}
    for title in SWEEPS:
        found[title] = swept(title, 1)
        print(table(title, found[title]), flush=True)
    draw(found).savefig(PICTURE, dpi=100)


if __name__ == "__main__":
    main()
