"""The tool's pose with its intermediate axis: of a posture, and in other frames."""

from typing import Any

import numpy as np

from plants.snake.kinematics import POINTS, corners, link_axis
from plants.snake.signals import ToolTarget
from systems.common.compiled import compiled
from systems.common.geometry import Pose, inwards, outwards, plus, row_of, sub


@compiled
def target_of(x: Any, h: float, tool: float) -> ToolTarget:
    """That of a posture x (7,); h is half the pitch, tool the tool's offset, in m."""
    c = np.empty((POINTS, 3))
    corners(x, h, tool, c)
    return ToolTarget(row_of(c, POINTS - 1), link_axis(c, 5, h), link_axis(c, 3, h))


@compiled
def seen_from(target: ToolTarget, A: Pose, B: Pose) -> ToolTarget:
    """A target given in frame A, in frame B."""
    p = sub(plus(A.p, outwards(A, target.p)), B.p)
    n, n_I = outwards(A, target.n), outwards(A, target.n_I)
    return ToolTarget(inwards(B, p), inwards(B, n), inwards(B, n_I))
