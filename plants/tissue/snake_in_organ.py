"""Where the snake truly is in the organ that it operates on.

Tube and organ move, the organ's tissue is kept in the frame E of its entry. What cuts
there is the tool with the last module: their pose in E is exact. The modules before
are taken as the inverse kinematics has them for a channel that stands still in E.
"""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform

from plants.snake.inverse_kernels import REACHED
from plants.snake.inverse_kinematics import tool_posture
from plants.snake.parameters import SnakeParams
from plants.snake.signals import Posture, ToolPose, ToolTarget
from plants.snake.tool_target import seen_from, target_of
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import Pose, along, column
from systems.common.signal import size, vector, view, writer
from systems.common.signals import MovingPoint

Floats = np.ndarray
write_target = writer(ToolTarget)


@compiled
def in_organ(
    x: Floats,
    h: float,
    tool: float,
    R_WM: Floats,
    p_WM: Floats,
    channel: float,
    E: Pose,
) -> Floats:
    """The elements of the `ToolTarget` in E of a posture x (7,) in C."""
    z = column(R_WM, 2)
    C = Pose(along(p_WM, channel, z), column(R_WM, 0), column(R_WM, 1), z)
    return write_target(seen_from(target_of(x, h, tool), C, E))


class SnakeInOrgan(Block):
    """The snake as the organ's tissue feels it.

    Port ``posture`` accepts the snake's true `Posture` in its channel.

    Port ``body_poses`` accepts the plant's port of that name.

    Port ``entry`` accepts the true entry p_WE, a `MovingPoint`.

    Port ``posture_E`` emits the `Posture` of the same tool in E.

    Port ``tool`` emits the `ToolPose` in E.
    """

    def __init__(
        self,
        snake: SnakeParams,
        tube: int,
        channel: float,
        R_WE: Floats,
    ) -> None:
        """Makes the block.

        Args:
            snake: Geometry, its travel that of the snake in its tube.
            tube: Place of the tube in `body_poses`.
            channel: Distance of frame C from the tube's origin along its z axis, in m.
            R_WE: Orientation of E, which the organ keeps.
        """
        super().__init__()
        self._snake, self._body, self._channel = snake, tube, channel
        self._axes = tuple(vector(axis) for axis in R_WE.T)
        self._length = 3 * snake.straight_module + snake.tool_offset
        self._posture = self.signal_in("posture", Posture)
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._entry = self.signal_in("entry", MovingPoint)
        reads = {
            self._posture.ticket(),
            self._poses.ticket(),
            self._entry.ticket(),
            self.time_ticket(),
        }
        self._target = self.cached("target", self._calc_target, reads)
        known = {self._target.ticket()}
        self.signal_out("posture_E", Posture, self._calc_posture, known)
        self.signal_out("tool", ToolPose, self._calc_tool, known)

    def _calc_target(self, context: Any) -> Floats:
        """Tool, its axis and the intermediate axis in E, (9,)."""
        X_WM = self._poses.Eval(context)[self._body]
        entry = vector(view(MovingPoint, self._entry.Eval(context)).p)
        target: Floats = in_organ(
            self._posture.Eval(context),
            self._snake.half_pitch,
            self._snake.tool_offset,
            X_WM.rotation().matrix(),
            X_WM.translation(),
            self._channel,
            Pose(entry, *self._axes),
        )
        return target

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
