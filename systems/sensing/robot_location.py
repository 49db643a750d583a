"""Robot location: where the robot's own tool is (Figure 2, the feedback)."""

from typing import Any

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.signals import ArmState
from plants.instruments.instrument import InstrumentParams
from systems.common.compiled import compiled
from systems.common.geometry import plus
from systems.common.serial_arm import read_arm, tip_position
from systems.common.signals import Bend, Point, RobotTool
from systems.common.step_block import StepBlock


@compiled
def _robot_tool(arm: Any, state: ArmState, fulcrum: Point) -> tuple[RobotTool]:
    return (RobotTool(fulcrum.p, tip_position(arm, state.q)),)


@compiled
def _bent_tool(
    arm: Any, state: ArmState, fulcrum: Point, bend: Bend
) -> tuple[RobotTool]:
    return (RobotTool(fulcrum.p, plus(tip_position(arm, state.q), bend.tip)),)


class RobotLocation(StepBlock):
    """The pose of the robot's instrument, from the measured joints.

    The arm's own kinematics, evaluated when somebody asks.

    Port ``arm_state`` accepts the measured `ArmState`.

    Port ``fulcrum`` accepts G_R, the `Point` that the shaft pivots about.

    Port ``bend`` accepts the shaft's `Bend`, where it is told.

    Port ``robot_tool`` emits the `RobotTool`, its tip as measured.
    """

    def __init__(
        self, instrument: InstrumentParams | None = None, bends: bool = False
    ) -> None:
        """Makes the block for an arm and its instrument, and if its bend is told."""
        super().__init__()
        plant = make_controller_plant(instrument=instrument)
        inputs = {"arm_state": ArmState, "fulcrum": Point}
        self.declare_map(
            _bent_tool if bends else _robot_tool,
            [read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))],
            inputs | ({"bend": Bend} if bends else {}),
            "robot_tool",
            RobotTool,
        )
