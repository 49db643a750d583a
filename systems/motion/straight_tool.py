"""Straight tool: where a straight shaft is to be for the bent one to be where it is to.

The arm carries the mount; its kinematics know of no bend. So it is sent to the tip less
the bend's way, and to the direction less its turn.
"""

from systems.common.compiled import compiled
from systems.common.geometry import cross, sub, unit
from systems.common.signals import Bend, ToolMotion
from systems.common.step_block import StepBlock


@compiled
def straightened(wanted: ToolMotion, bend: Bend) -> tuple[ToolMotion]:
    """The motion of a straight tool, its rates those of the bent one."""
    u = unit(sub(wanted.u, cross(bend.turn, wanted.u)), wanted.u)
    return (ToolMotion(sub(wanted.tip, bend.tip), u, wanted.v, wanted.du, wanted.time),)


class StraightTool(StepBlock):
    """Takes the bend out of the commanded tool.

    Port ``wanted`` accepts the commanded `ToolMotion` of the bent shaft.

    Port ``bend`` accepts the `Bend`.

    Port ``tool`` emits the `ToolMotion` that the arm is to follow.
    """

    def __init__(self) -> None:
        """Makes the block."""
        super().__init__()
        inputs = {"wanted": ToolMotion, "bend": Bend}
        self.declare_map(straightened, [], inputs, "tool", ToolMotion)
