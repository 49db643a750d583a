"""A resection against the tool's error: executed share, healthy tissue, contact.

Two plans on the grid of 1 mm, the ideal snake's and that of `resect_auto_small_real`.
The whole diagram runs once, on the first; how its balls strayed is scaled and played on
both in a kinematic loop.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.common.plots import save_figure
from diagrams.common.run import prepare, simulate
from diagrams.resection.metrics import body_error
from diagrams.resection.study import LOG_PERIOD
from diagrams.resection.tool_error import Strayed, carried_out, error_figure, stray
from diagrams.studies import load_scenario

ERRORS = (0.05e-3, 0.1e-3, 0.2e-3, 0.3e-3, 0.5e-3, 0.7e-3, 1.0e-3)
COARSE = ["spacing=0.001", "reach_effort=0.25"]
IDEAL = ["clearance=0.000075", "accuracy=0.000025", "snake.tool_radius=0.004"]
PLANS = {"plan of the ideal snake": IDEAL, "plan for the real one": []}
PICTURE = Path("out/resection_error.png")


def planned(seed: int, overrides: list[str]) -> Any:
    """The plan for a tumour."""
    of = [f"tumour.seed={seed}", *COARSE, *overrides]
    return prepare(load_scenario("resect_auto_small_real", of, seed))


def curves(seed: int) -> tuple[dict[str, list[Strayed]], np.ndarray]:
    """A curve of each plan, and what 95 % of body and tool keep to, in m (2,)."""
    plans = {name: planned(seed, of) for name, of in PLANS.items()}
    first = next(iter(plans.values()))
    run = simulate(replace(first))
    far, off = body_error(run), stray(run)
    kept = np.quantile([far[:, :-1].max(axis=1), far[:, -1]], 0.95, axis=1)
    told = {
        name: [carried_out(case, off, LOG_PERIOD, error) for error in ERRORS]
        for name, case in plans.items()
    }
    return told, kept


def report(seed: int = 1, scenes: int = 0) -> str:
    """The table, for a tumour's seed; `scenes` is for others."""
    del scenes
    told, kept = curves(seed)
    PICTURE.parent.mkdir(exist_ok=True)
    save_figure(error_figure(told), PICTURE)
    body, tool = 1e3 * kept
    lines = [f"  95 % of the time body within {body:.2f} mm, tool {tool:.2f} mm"]
    for name, rows in told.items():
        lines.append(f"  {name}: tool error mm, executed, healthy, contact %; depth mm")
        for row in rows:
            shares = (100 * row.executed, 100 * row.healthy, 100 * row.contact)
            lines.append(
                f"  {1e3 * row.error:6.2f}"
                + "".join(f"{share:9.2f}" for share in shares)
                + f"{1e3 * row.depth:9.2f}"
            )
    return "\n".join([*lines, f"  {PICTURE}"])
