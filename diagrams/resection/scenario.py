"""The scenario of a resection: every block's and part's parameters."""

from dataclasses import dataclass, field
from pathlib import Path

from diagrams.common.scenario import Scenario, ScenarioError
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.tissue import SyntheticTumour
from plants.tissue.tissue_carver import TissueCarverParams
from plants.tissue.volume import Access
from systems.resection.planning.planner import PlannerParams
from systems.resection.planning.procedure import Procedure
from systems.resection.wires.procedure_player import ProcedurePlayerParams
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams


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
