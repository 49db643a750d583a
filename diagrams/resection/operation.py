"""A resection's case: what is planned, reachable and done before anything moves."""

from dataclasses import dataclass, field, replace
import math
from pathlib import Path
import sys
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams.common.case import Case
from diagrams.common.progress import Progress, silent
from diagrams.common.scenario import ScenarioError
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.execution import Execution, load_execution
from plants.tissue.mask import load_mask
from plants.tissue.space import NEIGHBOUR
from plants.tissue.tissue import SyntheticTumour, Tissue, synthetic_tumour
from plants.tissue.volume import Access, make_volume
from systems.common.archive import before, beside
from systems.resection.planning.access import propose_access
from systems.resection.planning.next_entry import next_entries
from systems.resection.planning.next_tool import next_tools
from systems.resection.planning.planner import Planner
from systems.resection.planning.reach import (
    Lump,
    Reach,
    find_reach,
    load_reach,
    save_reach,
)
from systems.resection.planning.resumed import load_session
from systems.resection.planning.session import UPDATE, Session
from systems.resection.wires.procedure_player import schedule

LOG_PERIOD = 0.1
"""Of a resection's signals, in s; runs last a multiple of it."""


@dataclass(kw_only=True)
class Operation(Case):
    """A resection's case.

    Attributes:
        session: The plan.
        tumour: Its name.
        reach: The reachable part; None if nothing was planned.
        refusals: What was refused: procedure, reason, where [m], gap [m].
        access_time: Of proposing the entry and setting the session up, in s.
        planning_time: Of the procedures' checks and the planner, in s.
        done: What earlier runs carried out of the plan.
        choosing: What chooses while the robot works, an `online.Choosing`; None if all
            is planned before.
    """

    session: Session
    tumour: str
    reach: Reach | None = None
    refusals: list[dict[str, Any]] = field(default_factory=list)
    access_time: float = 0.0
    planning_time: float = 0.0
    done: Execution = field(default_factory=Execution)
    choosing: Any = None

    @property
    def waits(self) -> NDArray[np.float64]:
        """Time spent at each posture of the plan, in s, (n,)."""
        return waits_of(self.session, self.scenario)


def waits_of(session: Session, scenario: ResectionScenario) -> NDArray[np.float64]:
    """Time spent at each posture of a plan, in s, (n,)."""
    waits = np.zeros(len(session.postures))
    for channel in session.volume.more:
        waits[channel.time - 1] = scenario.entries.time
    for tool in session.tools:
        waits[tool.time - 1] = scenario.balls.time
    return waits


def tissue_of(scenario: ResectionScenario) -> Tissue:
    """The tissue before the operation."""
    if scenario.mask:
        return load_mask(scenario.mask, scenario.labels)
    return synthetic_tumour(scenario.tumour)


def new_session(
    scenario: ResectionScenario, progress: Progress = silent
) -> tuple[Session, str]:
    """A session at its beginning, and the tumour's name."""
    tissue = tissue_of(scenario)
    access = scenario.access
    if access.direction is None:
        with progress("where to enter", "of what is tried") as show:
            access = propose_access(
                tissue, access, scenario.snake, progress=lambda share: show(share, 1.0)
            ).access
    volume = make_volume(
        tissue,
        access,
        scenario.snake.body_radius,
        scenario.spacing,
        # A ball whose voxels keep a distance may stand out of them by half a diagonal.
        scenario.margin + scenario.tracking + NEIGHBOUR * scenario.spacing,
    )
    for note in [*tissue.notes, *volume.notes]:
        print(f"trocar: {tissue.name}: {note}", file=sys.stderr)
    session = Session(volume, scenario.snake, scenario.clearance, scenario.accuracy)
    return session, tissue.name


def resumed(file: Path, fresh: Session) -> Session:
    """The session of a file, which must be one of the same operation.

    Args:
        file: It is there.
        fresh: The operation at its beginning.

    Raises:
        ScenarioError: If it is another's; what differs is named.
        ValueError: If the file is damaged.
    """
    session = load_session(file)
    old, new = session.volume, fresh.volume
    updated = any(step.kind == UPDATE for step in session.steps)  # it shows another
    same = old.labels.shape == new.labels.shape and (
        updated or bool((old.labels == new.labels).all())
    )
    pairs = {"tumour or access": (bool(same), True), "margin": (old.margin, new.margin)}
    pairs |= {
        name: (getattr(session, name), getattr(fresh, name))
        for name in ("clearance", "accuracy")
    }
    told = vars(session.own)
    pairs |= {f"snake.{k}": (told[k], v) for k, v in vars(fresh.own).items()}
    differs = [
        f"{k} ({was} there, {is_now} here)"
        for k, (was, is_now) in pairs.items()
        if was != is_now
    ]
    if differs:
        raise ScenarioError(f"session {str(file)!r} differs in {', '.join(differs)}")
    return session


def outline(scenario: ResectionScenario) -> Operation:
    """An operation of which nothing is planned, on a tumour that is quickly made."""
    access = Access(direction=[0.0, 0.0, -1.0])
    session, tumour = new_session(
        replace(
            scenario, mask="", tumour=SyntheticTumour(), access=access, spacing=2e-3
        )
    )
    return Operation(scenario, session=session, tumour=tumour)


def prepare(scenario: ResectionScenario, progress: Progress) -> Operation:
    """Plans a scenario, or goes on with the plan in its session's file.

    Raises:
        ValueError: If tumour, access or session's files make no sense.
    """
    file = Path(scenario.session) if scenario.session else None
    start = perf_counter()
    session, tumour = new_session(scenario, progress)
    access_time = perf_counter() - start
    if file is not None and file.is_file():
        session = resumed(file, session)
    session.file = file
    reach = reach_of(session, scenario, progress)
    start = perf_counter()
    refusals = []
    for number, procedure in enumerate(scenario.procedures):
        if any(step.procedure == procedure for step in session.steps):
            continue  # resumed: it is done
        answer = session.commit(procedure)
        if not answer.feasible:
            refusals.append(
                {
                    "procedure": procedure.name or f"{number + 1}: {procedure.kind}",
                    "reason": answer.reason,
                    "where": answer.where,
                    "gap": answer.gap,
                    "text": answer.text,
                }
            )
    if scenario.choices is not None:
        pass  # it is chosen while the robot works
    elif scenario.automatic:
        reach = finish_plan(session, reach, scenario, progress)
    elif session.steps and session.steps[-1].kind != "home":
        session.go_home()
    planning_time = perf_counter() - start
    done = Execution()
    if file is not None:
        done = load_execution(
            beside(file, "executed"), session.postures, session.volume.labels.shape
        )
    return Operation(
        scenario,
        session=session,
        tumour=tumour,
        reach=reach,
        refusals=refusals,
        access_time=access_time,
        planning_time=planning_time,
        done=done,
    )


def reach_of(
    session: Session, scenario: ResectionScenario, progress: Progress
) -> Reach:
    """The reachable part, from beside the session's file if it was found before."""
    file, seed, effort = session.file, scenario.seed, scenario.reach_effort
    if file is not None:
        saved = load_reach(beside(file, "reach"), session, seed, effort)
        if saved is not None:
            return saved
    half = beside(file, "search") if file else None
    with progress("what can be reached", "of the tumour") as show:
        reach = find_reach(
            session, seed, effort, progress=lambda share: show(share, 1.0), file=half
        )
    if file and half:
        save_reach(beside(file, "reach"), reach, session, seed, effort)
        for path in (half, before(half)):
            path.unlink(missing_ok=True)
    return reach


def finish_plan(
    session: Session, reach: Reach, scenario: ResectionScenario, progress: Progress
) -> Reach:
    """Lets the planner do what is left, through as many entries as it may use.

    Args:
        session: The session; it may be in any of its entries.
        reach: What can be reached through the first one.
        scenario: The planner's parameters, and those of further entries.
        progress: Shows how far it is.

    Returns:
        What can be reached through all entries that are used.
    """
    params, mask, taken = scenario.entries, reach.mask, reach.time
    while True:
        if session.volume.more or session.tools:
            what = f"what entry {1 + len(session.volume.more)} can reach"
            with progress(what, "of the tumour") as show:
                reach = find_reach(
                    session,
                    scenario.seed,
                    scenario.reach_effort,
                    progress=lambda share: show(share, 1.0),
                    anew=False,
                )
            taken += reach.time
        run_planner(session, reach, scenario, progress)
        mask = mask | reach.mask | session.volume.resected
        fraction = session.reaches(mask)
        if change_tool(session, scenario):
            continue
        if 1 + len(session.volume.more) >= params.most:
            break
        with progress("a further entry", "of those tried") as show:
            found = next_entries(
                session, params, scenario.seed, lambda share: show(share, 1.0)
            )
        if not found:
            break
        print(
            f"trocar: a further entry: {found[0].text(session.volume)}", file=sys.stderr
        )
        session.enter_anew(found[0].X_WE)
    lumps = [lump for lump in reach.lumps if not _gone(session, lump)]
    return replace(reach, mask=mask, fraction=fraction, time=taken, lumps=lumps)


def change_tool(session: Session, scenario: ResectionScenario) -> bool:
    """Changes to the tool that adds most to what this one has removed, if one does."""
    params, entry = scenario.balls, session.entries
    used = sum(entry[tool.time] == entry[-1] for tool in session.tools)
    found = next_tools(session, params, scenario.seed) if used < params.most else []
    if not found:
        return False
    print(f"trocar: another tool: {found[0].text()}", file=sys.stderr)
    session.change_tool(found[0].radius)
    return True


def _gone(session: Session, lump: Lump) -> bool:
    """Whether what lies at a part's middle has been removed meanwhile."""
    volume = session.volume
    return bool(volume.resected[volume.index_of(np.array(lump.where))])


def run_planner(
    session: Session, reach: Reach, scenario: ResectionScenario, progress: Progress
) -> None:
    """Lets the planner do what can be reached through the entry that is open."""
    target = scenario.planner.target
    with progress("planning", "of what can be reached") as show:
        planner = Planner(
            session,
            reach,
            scenario.planner,
            lambda share: show(min(share, target), target),
            replace(scenario.player, lead=scenario.period),
        )
        planner.run()


def length(case: Operation) -> float:
    """How long the run takes in s; at most, if it is chosen while the robot works."""
    if case.scenario.choices is not None:
        return case.scenario.duration
    player = replace(case.scenario.player, lead=case.scenario.period)
    first = case.done.posture
    times = schedule(case.session.postures[first:], player, case.waits[first:])
    needed = float(times[-1]) + player.dwell
    return min(case.scenario.duration, math.ceil(needed / LOG_PERIOD) * LOG_PERIOD)
