"""`trocar rehearse`: a resection on tissue that yields, scanned and mended as it goes.

The plan is made and carried out in rounds. In each the robot removes as much as the
margin allows for: what is feared to have moved since the last scan stays below the
reserve. Then it withdraws. An image shows what is left and where it is now; or a scan
shows the cavity's surface, and where the tissue has moved to is fitted to that. The
session takes it over (`Session.update`).

Carried out means: the plan's postures, exactly, carve what is really there.
"""

import argparse
from dataclasses import dataclass, field, replace
import json
from pathlib import Path
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams.common.plots import COLORS, add_axes, new_figure, save_figure
from diagrams.common.progress import Progress, progress_bar
from diagrams.common.scenario import ScenarioError, refusals
from diagrams.resection.operation import new_session
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.labels import CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.tissue import Tissue
from plants.tissue.yielding import Field, YieldingTissue, apart
from systems.common.archive import whole
from systems.resection.planning.planner import Planner
from systems.resection.planning.reach import find_reach
from systems.resection.planning.registration import Surface, registered
from systems.resection.planning.session import Session
from systems.resection.wires.procedure_player import schedule

ROUNDS = 30
"""At most."""

PARTS = 6
"""Of a round, in each of which the tissue is taken to have stood still."""

BESIDE, UNSURE = 1.5, 0.15
"""Voxels about one of which it is not known when it was cut, in shares of a round."""

STROKES = 16
"""Begun in the first round."""

LEAST = 0.003
"""Of the tumour, that a round must remove for another to be worth it."""


def unmoved(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """No displacement."""
    return np.zeros_like(place)


@dataclass
class Rehearsal:
    """How it went.

    Attributes:
        reachable: Share of the tumour that can be reached if nothing moves.
        rounds: A row each: shares of the tumour `resected` and `healthy` so far,
            `time` [s], largest `moved` and `error` of the fit in the tumour that is
            left [m], `rms` of the scan's points [m].
        stopped: Why it ended before nothing more was to do; "" if it did not.
        hits: Checks that found the body in tissue.
        nearest: Least distance to what is critical, in m; None if nothing is.
        way: Of the tool, in m.
    """

    reachable: float
    rounds: list[dict[str, float]] = field(default_factory=list)
    stopped: str = ""
    hits: int = 0
    nearest: float | None = None
    way: float = 0.0

    def figures(self) -> dict[str, Any]:
        """As data."""
        last = self.rounds[-1] if self.rounds else {"resected": 0.0, "healthy": 0.0}
        return {
            "reachable_fraction": self.reachable,
            "resected_fraction": last["resected"],
            "healthy_fraction": last["healthy"],
            "min_critical_distance": self.nearest,
            "body_collisions": self.hits,
            "execution_time": last.get("time", 0.0),
            "path_length": self.way,
            "stopped": self.stopped,
            "rounds": self.rounds,
        }


def rehearse(scenario: ResectionScenario, progress: Progress) -> Rehearsal:
    """Plans, carries out, scans and mends until nothing more can be done.

    Raises:
        ValueError: If tumour or access make no sense.
    """
    params, scan = scenario.rehearsal, scenario.scan
    careful = replace(scenario, tracking=scenario.tracking + params.reserve)
    session, _ = new_session(careful, progress)
    volume = session.volume
    truth = YieldingTissue(
        volume, scenario.shift, scenario.snake, scenario.carver.pitch
    )
    # What the robot believes: the same, as far as scans show it.
    twin = YieldingTissue(volume, scenario.shift, scenario.snake, scenario.carver.pitch)
    belief = twin.material
    moved: Field = unmoved
    points = volume.points(volume.labels == TUMOUR)
    whole_tumour = len(points)
    middle, half = points.mean(axis=0), float(np.ptp(points, axis=0).max()) / 2
    player = replace(scenario.player, lead=scenario.period)
    rng = np.random.default_rng([scenario.seed, scenario.shift.seed])
    share = params.reserve / params.feared if scan.on else 1.0
    told, time = Rehearsal(0.0), 0.0
    budget = STROKES if scan.on else scenario.planner.budget
    for number in range(1, ROUNDS + 1):
        with progress(f"round {number}", "of the tumour") as show:
            reach = find_reach(
                session,
                scenario.seed,
                scenario.reach_effort,
                explain=False,
                anew=number == 1,
            )
            told.reachable = told.reachable or reach.fraction
            planner = Planner(session, reach, scenario.planner, player=player)
            target = min(planner.share + share, scenario.planner.target)
            passes = scenario.planner.passes if number == 1 else []
            planner.params = replace(
                scenario.planner, target=target, passes=passes, budget=budget
            )
            first = int(session.tree.size[1]) - 1
            before, thought = truth.resected, session.volume.tau.copy()
            planner.run()
            show(session.fraction, 1.0)
        postures = session.postures[first:]
        truth.carry_out(postures)
        went, count = progress_of(session, thought, first)
        time += float(schedule(postures, player)[-1]) + (scan.time if scan.on else 0.0)
        row = {"resected": truth.resected, "healthy": truth.healthy, "time": time}
        told.rounds.append(row)
        told.hits, told.way = truth.hits, truth.way
        told.nearest = truth.nearest if np.isfinite(truth.nearest) else None
        removed = truth.resected - before
        if not scan.on or (removed < LEAST and not planner.spent):
            break
        # As many strokes as remove what the margin allows for.
        budget = int(budget * min(max(share / max(removed, 1e-9), 0.5), 4.0))
        if scan.image:
            session.update(*believed(session, *truth.image(scan, rng)))
            continue
        _, gone = belief.shown(moved)
        swept = twin.last_swept(postures)
        cut = (swept >= 0) & ~gone
        since = np.where(cut, 1.0 - went[swept], 1.0)
        # Where the tool came again later, what is seen may be of either time.
        came = np.clip(session.volume.tau - first, 0, len(went) - 1)
        unsure = cut & (went[swept] - went[came] > UNSURE)
        unsure |= (swept >= 0) & gone
        seen = [
            Surface(
                away_from(truth.scan(scan, rng), unsure, volume),
                gone | cut,
                since,
                float(np.hypot(scan.noise, params.reserve)),
            )
        ]
        feared = params.feared * count / whole_tumour + params.reserve
        since_then, rms = registered(
            seen, volume.origin, volume.spacing, middle, half, feared
        )
        ends = np.searchsorted(went, np.linspace(0.0, 1.0, PARTS + 1))
        ends[-1] = len(went) - 1
        for part in range(PARTS):  # as it was when each was cut
            d = summed(moved, since_then, (part + 0.5) / PARTS)
            twin.stretch(postures[ends[part] : ends[part + 1] + 1], d)
        left = volume.points((belief.labels == TUMOUR) & ~belief.gone)
        if len(left) == 0:
            break
        yielded = longest(since_then(left))
        moved = summed(moved, since_then, 1.0)
        row["rms"], row["moved"] = rms, longest(moved(left))
        row["error"] = longest(moved(left) - truth.displaced()(left))
        if yielded > params.most * params.reserve:
            told.stopped = (
                f"the tissue moved by {1e3 * yielded:.2f} mm since the last scan: "
                f"expected at most {1e3 * params.most * params.reserve:.2f}"
            )
            break
        session.update(*believed(session, *belief.shown(moved)))
    return told


def summed(one: Field, other: Field, share: float) -> Field:
    """A displacement, and a share of another after it."""
    return lambda place: one(place) + share * other(place)


def progress_of(
    session: Session, before: NDArray[np.int32], first: int
) -> tuple[NDArray[np.float64], int]:
    """How a round's plan gets on.

    Args:
        session: The plan.
        before: Its arrival times before the round.
        first: Posture at which the round begins.

    Returns:
        At each of its postures the share of the round's tumour that has gone, (n,);
        and how many voxels that are.
    """
    volume = session.volume
    new = (volume.tau != SOLID) & (before == SOLID) & (volume.labels == TUMOUR)
    times = np.sort(volume.tau[new])
    visits = np.arange(first, int(session.tree.size[1]))
    return np.searchsorted(times, visits, "right") / max(len(times), 1), len(times)


def away_from(
    points: NDArray[np.float64], where: NDArray[np.bool_], volume: Any
) -> NDArray[np.float64]:
    """Points that lie beside certain voxels are left out: it is not known when cut."""
    kept = points[apart(volume, points, where, BESIDE)]
    return kept if len(kept) else points[:1]


def longest(vectors: NDArray[np.float64]) -> float:
    """Of vectors (n, 3) that which all but one in twenty are shorter than."""
    return float(np.quantile(np.linalg.norm(vectors, axis=1), 0.95))


def believed(
    session: Session, labels: NDArray[np.uint8], gone: NDArray[np.bool_]
) -> tuple[Tissue, NDArray[np.bool_], NDArray[np.bool_]]:
    """What is left of labels, what is tissue again, and what free."""
    volume = session.volume
    left = np.where(gone & (labels == TUMOUR), 0, labels)
    left[~np.isin(left, (TUMOUR, CRITICAL))] = 0
    X_WV = np.diag([volume.spacing] * 3 + [1.0])
    X_WV[:3, 3] = volume.origin
    tissue = Tissue(left.astype(np.uint8), volume.X_PW @ X_WV, "scan")
    return tissue, (volume.tau != SOLID) & ~gone, gone


def rehearse_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar rehearse`: 0 when it went to its end, 1 if it was stopped."""
    from diagrams.studies import load_scenario

    scenario = load_scenario(arguments.name, arguments.overrides, arguments.seed)
    if not isinstance(scenario, ResectionScenario):
        raise ScenarioError(f"{arguments.name!r} is no resection")
    out = arguments.out or Path("out") / "rehearsal"
    with refusals():
        told = rehearse(scenario, progress_bar)
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
