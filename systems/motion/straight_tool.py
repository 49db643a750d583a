"""Straight tool: where a straight shaft is to be for the bent one to be where it is to.

The arm carries the mount; its kinematics know of no bend. So it is sent to the tip less
the bend's way, and to the direction less its turn. If either is not known it stands
where it was sent last.
"""

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import cross, sub, unit
from systems.common.signal import finiteness, size, view
from systems.common.signals import Bend, ToolMotion
from systems.common.step_block import StepBlock

finite_motion, finite_bend = finiteness(ToolMotion), finiteness(Bend)


@compiled
def straightened(wanted: ToolMotion, bend: Bend) -> ToolMotion:
    """The motion of a straight tool, its rates those of the bent one."""
    u = unit(sub(wanted.u, cross(bend.turn, wanted.u)), wanted.u)
    return ToolMotion(sub(wanted.tip, bend.tip), u, wanted.v, wanted.du, wanted.time)


@compiled
def _step(
    last: ToolMotion, wanted: ToolMotion, bend: Bend
) -> tuple[ToolMotion, ToolMotion]:
    """The place where it is sent, to stand there, and the motion."""
    still = (0.0, 0.0, 0.0)
    if not finite_motion(wanted) or not finite_bend(bend):
        return last, last
    now = straightened(wanted, bend)
    return ToolMotion(now.tip, now.u, still, still, now.time), now


class StraightTool(StepBlock):
    """Takes the bend out of the commanded tool.

    Port ``wanted`` accepts the commanded `ToolMotion` of the bent shaft.

    Port ``bend`` accepts the `Bend`.

    Port ``tool`` emits the `ToolMotion` that the arm is to follow.
    """

    def __init__(self, period: float = 1 / 120) -> None:
        """Makes the block; `period` is that of the bend, in s."""
        super().__init__()
        # Until there is a command there is none, which the joints' block waits for.
        nowhere = view(ToolMotion, np.full(size(ToolMotion), np.nan))
        self.declare_step(
            _step,
            [],
            {"wanted": ToolMotion, "bend": Bend},
            nowhere,
            {"tool": ToolMotion},
            period,
            timed=False,
        )
