"""The robot's instrument as it truly is, for a tracker that sees its markers."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform

from systems.common.block import Block
from systems.common.signals import Shaft


class ToolShaft(Block):
    """The true shaft of an instrument.

    Port ``body_poses`` accepts the plant's `body_poses`.
    Port ``shaft`` emits the `Shaft`.
    """

    def __init__(self, body: int, length: float) -> None:
        """Makes the block for a body whose z axis is the shaft, `length` [m] long."""
        super().__init__()
        self._body, self._length = body, length
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self.signal_out("shaft", Shaft, self._calc_shaft, {self._poses.ticket()})

    def _calc_shaft(self, context: Any) -> np.ndarray:
        X_WM = self._poses.Eval(context)[self._body]
        u = X_WM.rotation().matrix()[:, 2]
        return np.concatenate([X_WM.translation() + self._length * u, u])


def add_tool_shaft(
    builder: Any, plant: Any, instrument: Any, markers: bool = False
) -> ToolShaft:
    """Adds the block as `tool_shaft` and wires it to the plant.

    Or as `marker_shaft`, the line that markers on the handle tell: it does not bend.
    """
    name, body = "tool_shaft", instrument.shaft
    if markers:
        name, body = "marker_shaft", instrument.body
    block: ToolShaft = builder.AddNamedSystem(
        name, ToolShaft(int(body.index()), instrument.length)
    )
    builder.Connect(plant.GetOutputPort("body_poses"), block.GetInputPort("body_poses"))
    return block
