"""The scenario of a resection, and the plan that comes of it before anything moves."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
import math
from pathlib import Path
import sys
from time import perf_counter
from typing import Any

from pydrake.common.yaml import yaml_dump_typed

from diagrams.common.progress import progress_bar
from diagrams.common.scenario import Scenario, ScenarioError
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.tissue.execution import Execution, load_execution
from plants.tissue.mask import load_mask
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.space import NEIGHBOUR
from plants.tissue.tissue import SyntheticTumour, Tissue, synthetic_tumour
from plants.tissue.tissue_carver import TissueCarverParams
from plants.tissue.volume import Access, make_volume
from systems.common.archive import beside
from systems.resection.planning.access import propose_access
from systems.resection.planning.planner import Planner, PlannerParams
from systems.resection.planning.procedure import Procedure
from systems.resection.planning.reach import Reach, find_reach, load_reach, save_reach
from systems.resection.planning.session import Session, load_session
from systems.resection.wires.procedure_player import ProcedurePlayerParams, schedule
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams

LOG_PERIOD = 0.1
"""Of a resection's signals, in s; runs last a multiple of it."""


@dataclass
class ResectionScenario(Scenario):
    """Martin et al., section V: a tumour is resected by a sequence of procedures.

    `duration` is the longest; the run ends when the plan has been carried out.

    Attributes:
        mask: A patient's mask (NRRD, NIfTI, MetaImage); the synthetic tumour if empty.
        labels: What the mask's labels mean.
        tumour: The synthetic tumour.
        access: Point and direction of the channel; proposed without a direction.
        spacing: Edge of a voxel in m.
        margin: Distance to what is critical that must be kept, in m.
        tracking: What the plan keeps beyond that, for tracking errors, in m.
        clearance: Between body and tissue in the plan, in m.
        accuracy: By which the plan takes the tool for smaller where it frees space,
            in m.
        procedures: The surgeon's, in their order; refused ones are left out.
        automatic: Whether the planner goes on after them.
        planner: How.
        reach_effort: Scales how long the reachable part is searched.
        session: A session's file to save plan and execution to, and to resume both
            from after the program was killed; none if empty.
        period: Of drums and inverse kinematics in s, and CENIC's longest step.
    """

    mask: str = field(default="", metadata={"file": True})
    labels: MaskLabels = field(default_factory=MaskLabels)
    tumour: SyntheticTumour = field(default_factory=SyntheticTumour)
    access: Access = field(default_factory=Access)
    spacing: float = 0.5e-3
    margin: float = 1.0e-3
    tracking: float = 0.15e-3
    clearance: float = 0.075e-3
    accuracy: float = 0.025e-3
    procedures: list[Procedure] = field(default_factory=list)
    automatic: bool = False
    planner: PlannerParams = field(default_factory=PlannerParams)
    reach_effort: float = 1.0
    session: str = ""
    period: float = 0.02
    snake: SnakeParams = field(default_factory=SnakeParams)
    drive: SnakeDriveParams = field(default_factory=SnakeDriveParams)
    player: ProcedurePlayerParams = field(default_factory=ProcedurePlayerParams)
    resection_ik: ResectionIkParams = field(default_factory=ResectionIkParams)
    inverse_actuation: WireInverseActuationParams = field(
        default_factory=WireInverseActuationParams
    )
    drums: WireDrumsParams = field(default_factory=WireDrumsParams)
    tension: WireTensionParams = field(default_factory=WireTensionParams)
    watch: WireWatchParams = field(default_factory=WireWatchParams)
    carver: TissueCarverParams = field(default_factory=TissueCarverParams)


@dataclass
class Operation:
    """A scenario planned.

    Attributes:
        session: The plan.
        reach: The reachable part.
        refusals: What was refused: procedure, reason, where [m], gap [m].
        planning_time: Of the procedures' checks and the planner, in s.
        name: Of the tumour.
    """

    session: Session
    reach: Reach
    refusals: list[dict[str, Any]]
    planning_time: float
    name: str

    def duration(self, player: ProcedurePlayerParams, first: int = 0) -> float:
        """Simulated time in s that carrying it out takes from a posture on."""
        return float(schedule(self.session.postures[first:], player)[-1]) + player.dwell


def check(scenario: ResectionScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    if not scenario.period > 0.0:
        raise ScenarioError(f"period={scenario.period} s: expected > 0, e.g. 0.02")
    for name in ("margin", "tracking", "clearance", "accuracy"):
        if not 0.0 <= getattr(scenario, name) <= 0.01:
            raise ScenarioError(
                f"{name}={getattr(scenario, name)} m: expected 0 to 0.01"
            )
    if not 0.0 < scenario.reach_effort <= 100.0:
        raise ScenarioError(
            f"reach_effort={scenario.reach_effort}: expected > 0, at most 100"
        )
    for part in vars(scenario).values():
        if hasattr(part, "check"):
            part.check()
    for procedure in scenario.procedures:
        procedure.check(scenario.snake)
    if not 1e-4 <= scenario.spacing <= 5e-3:
        raise ScenarioError(
            f"spacing={scenario.spacing} m: expected 0.0001 to 0.005; nearest "
            f"{min(max(scenario.spacing, 1e-4), 5e-3):g}"
        )
    if scenario.mask and not Path(scenario.mask).is_file():
        raise ScenarioError(f"mask={scenario.mask!r}: no such file")


def tissue_of(scenario: ResectionScenario) -> Tissue:
    """The tissue before the operation."""
    if scenario.mask:
        return load_mask(scenario.mask, scenario.labels)
    return synthetic_tumour(scenario.tumour)


def new_session(scenario: ResectionScenario) -> tuple[Session, str]:
    """A session at its beginning, and the tumour's name."""
    tissue = tissue_of(scenario)
    access = scenario.access
    if access.direction is None:
        access = propose_access(tissue, access, scenario.snake).access
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


def plan_operation(scenario: ResectionScenario) -> Operation:
    """Plans a scenario; the same scenario is planned once.

    Raises:
        ScenarioError: If tumour, access or session's file make no sense.
    """
    try:
        return _planned(yaml_dump_typed(scenario), _Holder(scenario))
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(str(error)) from error


class _Holder:
    """Takes a scenario past the cache's key, which is its text."""

    def __init__(self, scenario: ResectionScenario) -> None:
        self.scenario = scenario

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Holder)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=1)
def _planned(text: str, holder: _Holder) -> Operation:
    scenario = holder.scenario
    file = Path(scenario.session) if scenario.session else None
    session, name = new_session(scenario)
    if file is not None and file.is_file():
        fresh, session = session, load_session(file)
        if session.volume.labels.shape != fresh.volume.labels.shape or (
            (session.volume.labels != fresh.volume.labels).any()
        ):
            raise ScenarioError(f"session {str(file)!r} is of another tumour or access")
    session.file = file
    reach = reach_of(session, scenario)
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
    if scenario.automatic:
        finish_plan(session, reach, scenario)
    elif session.steps and session.steps[-1].kind != "home":
        session.go_home()
    return Operation(session, reach, refusals, perf_counter() - start, name)


def reach_of(session: Session, scenario: ResectionScenario) -> Reach:
    """The reachable part, from beside the session's file if it was found before."""
    file, seed, effort = session.file, scenario.seed, scenario.reach_effort
    if file is not None:
        saved = load_reach(beside(file, "reach"), session, seed, effort)
        if saved is not None:
            return saved
    with progress_bar("what can be reached", "of the tumour") as progress:
        reach = find_reach(
            session, seed, effort, progress=lambda share: progress(share, 1.0)
        )
    if file is not None:
        save_reach(beside(file, "reach"), reach, session, seed, effort)
    return reach


def finish_plan(session: Session, reach: Reach, scenario: ResectionScenario) -> None:
    """Lets the planner do what is left."""
    target = scenario.planner.target
    with progress_bar("planning", "of what can be reached") as progress:
        planner = Planner(
            session,
            reach.mask,
            scenario.planner,
            lambda share: progress(min(share, target), target),
        )
        planner.run()


def executed(scenario: ResectionScenario) -> Execution:
    """What has been carried out of a scenario's plan, by its session's files.

    Raises:
        ScenarioError: If the file is damaged, or of another plan.
    """
    if not scenario.session:
        return Execution()
    file = beside(Path(scenario.session), "executed")
    try:
        return load_execution(file, plan_operation(scenario).session.postures)
    except ValueError as error:
        raise ScenarioError(str(error)) from error


def length(scenario: ResectionScenario) -> float:
    """How long the run takes in s."""
    player = replace(scenario.player, lead=scenario.period)
    needed = plan_operation(scenario).duration(player, executed(scenario).posture)
    return min(scenario.duration, math.ceil(needed / LOG_PERIOD) * LOG_PERIOD)
