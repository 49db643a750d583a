"""The scenario of a resection: every block's and part's parameters."""

from dataclasses import dataclass
from pathlib import Path

from diagrams.common.scenario import Scenario
from diagrams.snake.robot import FreeBallsParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.tissue import SyntheticTumour
from plants.tissue.tissue_carver import TissueCarverParams
from plants.tissue.volume import Access
from plants.tissue.yielding import CavityScanParams, TissueShiftParams
from systems.common.parameter import Rules, parameter, part
from systems.resection.planning.next_entry import EntriesParams
from systems.resection.planning.next_tool import ToolsParams
from systems.resection.planning.planner import PlannerParams
from systems.resection.planning.procedure import Procedure, check_procedure
from systems.resection.wires.procedure_player import ProcedurePlayerParams
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams


@dataclass
class RehearsalParams:
    """A resection on tissue that yields, in rounds between scans."""

    reserve: float = parameter(
        0.5e-3,
        "kept to what is critical for what moves from one scan to the next",
        "m",
        above=0.0,
        most=5e-3,
    )
    feared: float = parameter(
        3.0e-3,
        "displacement that is reckoned with when all of the tumour is gone",
        "m",
        above=0.0,
        most=0.02,
    )
    most: float = parameter(
        2.0,
        "times the reserve that a scan may show before the robot stops",
        least=1.0,
        most=10.0,
    )


@dataclass
class ResectionScenario(FreeBallsParams, Scenario):
    """Martin et al., section V: a tumour is resected by a sequence of procedures.

    `duration` is the longest; the run ends when the plan has been carried out.
    """

    mask: str = parameter(
        "",
        "a patient's mask (NRRD, NIfTI, MetaImage, DICOM's SEG or RTSTRUCT); the "
        "synthetic tumour if empty",
        file=True,
    )
    image: str = parameter(
        "",
        "the patient's own image, shown in slices in the browser (formats as a mask)",
        file=True,
    )
    labels: MaskLabels = part(MaskLabels)
    tumour: SyntheticTumour = part(SyntheticTumour)
    access: Access = part(Access)
    spacing: float = parameter(0.5e-3, "edge of a voxel", "m", least=1e-4, most=5e-3)
    margin: float = parameter(
        1.0e-3,
        "distance to what is critical that must be kept",
        "m",
        least=0.0,
        most=0.01,
    )
    tracking: float = parameter(
        0.15e-3,
        "what the plan keeps beyond that, for tracking errors",
        "m",
        least=0.0,
        most=0.01,
    )
    clearance: float = parameter(
        0.075e-3, "between body and tissue in the plan", "m", least=0.0, most=0.01
    )
    accuracy: float = parameter(
        0.025e-3,
        "by which the plan takes the tool for smaller where it frees space",
        "m",
        least=0.0,
        most=0.01,
    )
    procedures: list[Procedure] = parameter(
        [], "the surgeon's, in their order; refused ones are left out", shape=(-1,)
    )
    automatic: bool = parameter(False, "whether the planner goes on after them")
    choices: str | None = parameter(
        None,
        "CSV `t,line` of the console's lines said while the robot works, after the "
        "procedures; '': by who is there",
        file=True,
    )
    planner: PlannerParams = part(PlannerParams)
    entries: EntriesParams = part(EntriesParams)
    balls: ToolsParams = part(ToolsParams)
    reach_effort: float = parameter(
        1.0, "scales how long the reachable part is searched", above=0.0, most=100.0
    )
    # Both are resumed from it after the program was killed.
    session: str = parameter(
        "", "a session's file to save plan and execution to; none if empty"
    )
    period: float = parameter(
        0.02,
        "of drums and inverse kinematics, and CENIC's longest step",
        "s",
        least=1e-3,
        most=0.1,
    )
    wires: str = parameter(
        "drums",
        "as stiff as their drums, the paper's ideal; or statics, in which each ball "
        "turns as wires, core, friction and load have it",
        choices=("drums", "statics"),
    )
    snake: SnakeParams = part(SnakeParams)
    drive: SnakeDriveParams = part(SnakeDriveParams)
    player: ProcedurePlayerParams = part(ProcedurePlayerParams)
    resection_ik: ResectionIkParams = part(lambda: ResectionIkParams(bend_rate=2.0))
    inverse_actuation: WireInverseActuationParams = part(WireInverseActuationParams)
    drums: WireDrumsParams = part(WireDrumsParams)
    tension: WireTensionParams = part(WireTensionParams)
    watch: WireWatchParams = part(WireWatchParams)
    carver: TissueCarverParams = part(TissueCarverParams)
    shift: TissueShiftParams = part(TissueShiftParams)
    scan: CavityScanParams = part(CavityScanParams)
    rehearsal: RehearsalParams = part(RehearsalParams)

    def rules(self) -> Rules:
        """Procedures are the robot's, files are there, and wires know their load."""
        yield from super().rules()
        for index, procedure in enumerate(self.procedures):
            check_procedure(procedure, self.snake, f"procedures[{index}]")
        for name in ("mask", "image", "choices"):
            file = getattr(self, name)
            yield not file or Path(file).is_file(), name, "a file that is there"
