"""The passive wrist over stiffness, breathing, rate, first error: the real arm.

Every case runs in closed loop with the arm, unknown stiffness, sensor noise and drift,
a swing of 14 degrees from the start. The waves alternate between sine and ventilator.
`wrist_sweep.png` is its heat map, `wrist_sweep.csv` the figures. The random cases of
`monte_carlo` ask whether the estimator is as sure as it should be: the share of
normalised squared errors above the 95 % point, after 15 s.
"""

from concurrent.futures import ProcessPoolExecutor
import csv
from dataclasses import dataclass
import itertools
import math
from pathlib import Path

import numpy as np

from diagrams.common.plots import add_axes, new_figure, save_figure
from diagrams.common.run import simulate
from diagrams.wrist.scenario import WristScenario
from plants.abdomen.wall_motion import WallMotionParams
from systems.passive_wrist.arc_navigation import ArcParams

STIFFNESS = (100.0, 200.0, 500.0, 1000.0, 1500.0, 3000.0)
AMPLITUDE = (0.0, 0.002, 0.005, 0.010)
RATE = (0.2, 0.35)
FIRST_ERROR = (0.0, 0.010, 0.020)
HARDEST = 15.0  # N: stiffness times amplitude
WAVES = ("sine", "ventilator")
DURATION = 22.0


@dataclass
class Case:
    """One case: SI units."""

    stiffness: float
    amplitude: float
    rate: float
    first_error: float
    wave: str
    phase: float
    seed: int
    delay: int = 0
    frequency: float = 120.0


def sweep(seed: int) -> list[Case]:
    """Every combination within the limit on stiffness times amplitude."""
    grid = itertools.product(STIFFNESS, AMPLITUDE, RATE, FIRST_ERROR)
    return [
        Case(k, a, f, e, WAVES[i % 2], (0.137 * i) % 1.0, seed + i)
        for i, (k, a, f, e) in enumerate(grid)
        if k * a <= HARDEST + 1e-9
    ]


def monte_carlo(seed: int, count: int) -> list[Case]:
    """Random walls, rates, waves and first errors."""
    rng = np.random.default_rng(seed)
    cases = []
    for i in range(count):
        stiffness = float(np.exp(rng.uniform(math.log(150.0), math.log(2500.0))))
        largest = min(0.010, HARDEST / stiffness)
        cases.append(
            Case(
                stiffness,
                float(rng.uniform(0.0, largest)),
                float(rng.uniform(0.15, 0.35)),
                float(rng.uniform(0.0, 0.02)),
                WAVES[int(rng.integers(2))],
                float(rng.uniform()),
                seed + i,
            )
        )
    return cases


def margins(seed: int) -> list[Case]:
    """Control rates, and sensors that are late against the pose, in samples."""
    return [
        Case(k, 0.005, 0.2, 0.01, "ventilator", 0.2, seed, delay, frequency)
        for k in (100.0, 500.0, 3000.0)
        for frequency in (60.0, 120.0, 240.0)
        for delay in ((0, 1, 2, 4) if frequency == 120.0 else (0,))
    ]


def margin_plot(rows: list[dict[str, object]], path: Path) -> None:
    """Force against control rate and against delay, as a picture."""
    figure = new_figure(8.0, 3.0)
    left, right = add_axes(figure, 1, 2, 1), add_axes(figure, 1, 2, 2)
    for stiffness in (100.0, 500.0, 3000.0):
        here = [row for row in rows if row["stiffness"] == stiffness]
        prompt = [row for row in here if row["delay"] == 0]
        late = [row for row in here if row["frequency"] == 120.0]
        force, label = "rms_lateral_force", f"{stiffness:.0f} N/m"
        left.plot(column(prompt, "frequency"), column(prompt, force), "o-", label=label)
        right.plot(column(late, "delay") / 0.12, column(late, force), "o-", label=label)
    left.set(xlabel="control rate [Hz]", ylabel="rms force [N]", ylim=(0, None))
    right.set(xlabel="force late by [ms], at 120 Hz", ylim=(0, None))
    right.legend(frameon=False)
    save_figure(figure, path)


def scenario(case: Case, duration: float = DURATION) -> WristScenario:
    """The wrist study of a case: amplitude 1.5 times as large along the shaft."""
    a, e = case.amplitude, case.first_error
    result = WristScenario(
        system="wrist",
        duration=duration,
        seed=case.seed,
        wrist="pwe",
        first_guess=[0.6 * e, 0.0, 0.8 * e],
        measure_from=3.0,
        arcs=ArcParams(angle=0.25, swing=7.0),
        wall_motion=WallMotionParams(
            breathing=[a, 0.3 * a, 1.5 * a],
            rate=case.rate,
            wave=case.wave,
            phase=case.phase,
        ),
    )
    result.robot.p_WP = [0.0, 0.0, -0.15]
    result.abdomen.stiffness = case.stiffness
    result.tool_wrench.delay = case.delay
    for part in (
        result.joints,
        result.tool_wrench,
        result.fulcrum_estimator,
        result.passive_wrist,
    ):
        part.period = 1.0 / case.frequency
    return result


KEYS = (
    *("rms_lateral_force", "max_lateral_force", "max_lateral_force_ever"),
    *("rms_fulcrum_error", "nees_above_95", "stiffness_estimate", "time_frozen"),
    *("breathing_rate_estimate", "jumps_followed", "estimates_refused"),
)


def run_case(case: Case) -> dict[str, object]:
    """The figures of a case, what it was beside them."""
    run = simulate(scenario(case))
    figures = {key: run.metrics.get(key) for key in KEYS}
    return {**vars(case), **figures, "error": run.error}


def column(rows: list[dict[str, object]], key: str) -> np.ndarray:
    """One figure of all cases."""
    return np.array([row[key] for row in rows], float)


def heat_map(rows: list[dict[str, object]], path: Path) -> None:
    """Worst force by stiffness and amplitude, as a picture."""
    figure = new_figure(8.6, 3.6)
    stiffness, amplitude = column(rows, "stiffness"), column(rows, "amplitude")
    for place, (key, title) in enumerate(
        (
            ("rms_lateral_force", "worst rms force [N]"),
            ("max_lateral_force", "worst peak force after 3 s [N]"),
        ),
        start=1,
    ):
        value = column(rows, key)
        grid = np.full((len(AMPLITUDE), len(STIFFNESS)), np.nan)
        for i, a in enumerate(AMPLITUDE):
            for j, k in enumerate(STIFFNESS):
                here = np.isclose(amplitude, a) & np.isclose(stiffness, k)
                if here.any():
                    grid[i, j] = value[here].max()
        axes = add_axes(figure, 1, 2, place)
        axes.grid(False)
        image = axes.imshow(grid, origin="lower", cmap="viridis", aspect="auto", vmin=0)
        middle = np.nanmax(grid) / 2
        for i, j in np.argwhere(np.isfinite(grid)):
            color = "w" if grid[i, j] < middle else "k"
            axes.text(j, i, f"{grid[i, j]:.2f}", ha="center", va="center", color=color)
        axes.set_xticks(range(len(STIFFNESS)), [f"{k:.0f}" for k in STIFFNESS])
        axes.set_yticks(range(len(AMPLITUDE)), [f"{a * 1e3:.0f}" for a in AMPLITUDE])
        axes.set(xlabel="stiffness [N/m]", ylabel="breathing [mm]", title=title)
        figure.colorbar(image, ax=axes)
    save_figure(figure, path)


def summary(rows: list[dict[str, object]], title: str) -> str:
    """What the cases came to."""
    rms, peak = column(rows, "rms_lateral_force"), column(rows, "max_lateral_force")
    above = column(rows, "nees_above_95")
    broken = [row for row in rows if row["error"]]
    lines = [f"{title}: {len(rows)} cases, {len(broken)} ended early"]
    lines.append(
        f"  rms force  median {np.median(rms):.3f} N, worst {rms.max():.3f} N\n"
        f"  peak after 3 s  worst {peak.max():.2f} N, over 5 N {np.sum(peak > 5.0)}\n"
        f"  shaft off the fulcrum  median "
        f"{np.median(column(rows, 'rms_fulcrum_error')) * 1e3:.3f} mm rms\n"
        f"  normalised errors above the 95 % point  mean {np.nanmean(above):.3f}, "
        f"worst {np.nanmax(above):.2f}\n"
        f"  frozen  {np.sum(column(rows, 'time_frozen') > 0)} cases"
    )
    for wave in WAVES:
        some = [row for row in rows if row["wave"] == wave]
        if some:
            lines.append(
                f"  {wave}: worst rms {column(some, 'rms_lateral_force').max():.3f} N, "
                f"peak {column(some, 'max_lateral_force').max():.2f} N, above "
                f"{np.nanmean(column(some, 'nees_above_95')):.3f}"
            )
    return "\n".join(lines)


def save(rows: list[dict[str, object]], path: Path) -> None:
    """Writes the cases as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def report(seed: int, scenes: int) -> str:
    """Runs sweep, margins and random walls; writes CSV files and plots."""
    out = Path("out/wrist_sweep")
    out.mkdir(parents=True, exist_ok=True)
    texts = []
    for name, cases, draw in (
        ("sweep", sweep(seed), heat_map),
        ("margins", margins(seed), margin_plot),
        ("random walls", monte_carlo(seed, 24), None),
    ):
        with ProcessPoolExecutor() as pool:
            rows = list(pool.map(run_case, cases))
        stem = f"wrist_{name.replace(' ', '_')}"
        save(rows, out / f"{stem}.csv")
        if draw is not None:
            draw(rows, out / f"{stem}.png")
        texts.append(summary(rows, name))
    return "\n".join([*texts, f"  cases and plots: {out}/"])
