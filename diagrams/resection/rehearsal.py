"""`trocar rehearse`: a resection on tissue that yields, seen and mended as it goes.

The plan is made and carried out in rounds (`rounds`). In each the robot removes as much
as the margin allows for: what is feared to have moved since the last scan stays below
the reserve. Then it withdraws, and what is seen then tells where the tissue is now
(`sight`). The session takes it over (`Session.update`).

Carried out means: the plan's postures, exactly, carve what is really there.
"""

import argparse
import json
from pathlib import Path
import sys
from typing import Any

from diagrams.common.plots import COLORS, add_axes, new_figure, save_figure
from diagrams.common.progress import progress_bar
from diagrams.common.scenario import ScenarioError, refusals
from diagrams.resection.rounds import Rehearsal, rehearse
from diagrams.resection.scenario import ResectionScenario
from systems.common.archive import whole


def rehearse_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar rehearse`: 0 when it went to its end, 1 if it was stopped."""
    from diagrams.studies import load_scenario

    scenario = load_scenario(arguments.name, arguments.overrides, arguments.seed)
    if not isinstance(scenario, ResectionScenario):
        raise ScenarioError(f"{arguments.name!r} is no resection")
    out = arguments.out or Path("out") / "rehearsal"
    with refusals():
        told = rehearse(scenario, progress_bar, out / "rehearsal.state")
    out.mkdir(parents=True, exist_ok=True)
    with whole(out / "rehearsal.json") as draft:
        draft.write_text(json.dumps(told.figures(), indent=2) + "\n", encoding="utf-8")
    save_figure(picture(told, scenario), out / "rehearsal.png")
    print(table(told))
    print(out / "rehearsal.png")
    if told.stopped:
        print(f"trocar: stopped: {told.stopped}", file=sys.stderr)
    return 1 if told.stopped else 0


def table(told: Rehearsal) -> str:
    """Rounds, and what they came to."""
    rows = ["round   resected   healthy     time    moved   error of the fit"]
    for number, row in enumerate(told.rounds, 1):
        share, wrong = 100 * row["resected"], 100 * row["healthy"]
        text = (
            f"{number:5}   {share:6.1f} %   {wrong:5.2f} %  {row['time'] / 60:5.1f} min"
        )
        if "moved" in row:
            text += f"  {1e3 * row['moved']:4.2f} mm  {1e3 * row['error']:4.2f} mm"
        rows.append(text)
    share = told.figures()["resected_fraction"] / max(told.reachable, 1e-9)
    near = (
        ""
        if told.nearest is None
        else (f", {1e3 * told.nearest:.2f} mm from what is critical at least")
    )
    rows.append(
        f"{100 * share:.1f} % of the reachable {100 * told.reachable:.1f} %, body in "
        f"tissue at {told.hits} checks{near}"
    )
    return "\n".join(rows)


def picture(told: Rehearsal, scenario: ResectionScenario) -> Any:
    """Resected and healthy tissue over time; how far it moved, and the fit's error."""
    figure = new_figure(9.0, 3.4)
    left, right = add_axes(figure, 1, 2, 1), add_axes(figure, 1, 2, 2)
    time = [0.0, *(row["time"] / 60 for row in told.rounds)]
    for key, colour in (("resected", "robot"), ("healthy", "obstacle")):
        share = [0.0, *(100 * row[key] for row in told.rounds)]
        left.plot(time, share, "o-", ms=3, color=COLORS[colour], label=key)
    left.axhline(100 * told.reachable, ls="--", lw=1.0, color=COLORS["target"])
    left.set(xlabel="time [min]", ylabel="of the tumour [%]", ylim=(0, 105))
    left.legend()
    seen = [row for row in told.rounds if "moved" in row]
    for key, colour in (("moved", "robot"), ("error", "obstacle")):
        right.plot(
            [row["time"] / 60 for row in seen],
            [1e3 * row[key] for row in seen],
            "o-", ms=3, color=COLORS[colour], label=key,
        )  # fmt: skip
    right.set(xlabel="time [min]", ylabel="tumour that is left, 95 % [mm]")
    right.set_ylim(0.0, None)
    right.legend()
    most = 1e3 * scenario.shift.most
    figure.suptitle(f"tissue yields by up to {most:.1f} mm", fontsize=10)
    return figure
