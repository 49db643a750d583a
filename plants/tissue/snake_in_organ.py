"""Where the snake truly is in the organ that it operates on.

Tube and organ move, the organ's tissue is kept in the frame E of its entry. What cuts
there is the tool with the last module: their pose in E is exact. The modules before
are taken as the inverse kinematics has them for a channel that stands still in E.
"""

from typing import Any

import numpy as np

from plants.instruments.wrist_sensor import Mount
from plants.snake.inverse_kernels import REACHED
from plants.snake.inverse_kinematics import tool_posture
from plants.snake.parameters import SnakeParams
from plants.snake.signals import Posture, ToolPose, ToolTarget
from plants.snake.tool_target import seen_from, target_of
from systems.common.compiled import compiled, packed
from systems.common.geometry import Pose, along, row_of
from systems.common.signal import size, view
from systems.common.signals import MovingPoint
from systems.common.step_block import StepBlock

Floats = np.ndarray


@compiled
def _in_organ(
    c: Any, posture: Posture, mount: Mount, entry: MovingPoint
) -> tuple[ToolTarget]:
    """The tool of a posture in C, in E."""
    p_WC = along(mount.p, c.channel, mount.z)
    C = Pose(p_WC, mount.x, mount.y, mount.z)
    E = Pose(entry.p, row_of(c.R_EW, 0), row_of(c.R_EW, 1), row_of(c.R_EW, 2))
    target = target_of(np.array(posture.x), c.half_pitch, c.tool_offset)
    return (seen_from(target, C, E),)


class SnakeInOrgan(StepBlock):
    """The snake as the organ's tissue feels it.

    Port ``posture`` accepts the snake's true `Posture` in its channel.

    Port ``mount`` accepts the tube's frame, a `Mount`.

    Port ``entry`` accepts the true entry p_WE, a `MovingPoint`.

    Port ``posture_E`` emits the `Posture` of the same tool in E.

    Port ``tool`` emits the `ToolPose` in E.
    """

    def __init__(
        self,
        snake: SnakeParams,
        channel: float,
        R_WE: Floats,
    ) -> None:
        """Makes the block.

        Args:
            snake: Geometry, its travel that of the snake in its tube.
            channel: Distance of frame C from the tube's origin along its z axis, in m.
            R_WE: Orientation of E, which the organ keeps.
        """
        super().__init__()
        self._snake = snake
        self._length = 3 * snake.straight_module + snake.tool_offset
        constants = packed(
            R_EW=np.array(R_WE).T.copy(),
            channel=channel,
            half_pitch=snake.half_pitch,
            tool_offset=snake.tool_offset,
        )
        inputs = {"posture": Posture, "mount": Mount, "entry": MovingPoint}
        run, reads = self._runner(
            _in_organ, [constants], [], inputs, [ToolTarget], False, {}
        )
        self._target = self.cached("target", run, reads)
        known = {self._target.ticket()}
        self.signal_out("posture_E", Posture, self._calc_posture, known)
        self.signal_out("tool", ToolPose, self._calc_tool, known)

    def _calc_posture(self, context: Any) -> Floats:
        target = self._target.Eval(context)
        depth = view(ToolTarget, target).p[2]
        if depth > -self._snake.tool_radius:
            x, status = tool_posture(target, self._snake)
            if status == REACHED:
                return np.array(x)
        # Before the organ nothing is touched: straight, the tool at its depth.
        return np.array([depth - self._length, *np.zeros(6)])

    def _calc_tool(self, context: Any) -> Floats:
        tool: Floats = self._target.Eval(context)[: size(ToolPose)]
        return tool
