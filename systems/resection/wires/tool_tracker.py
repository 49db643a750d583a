"""Tool tracker: measures the tool's pose, late and with noise."""

from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.signals import ToolPose
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, cross, unit
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, example, finiteness, size
from systems.common.step_block import StepBlock

NEVER = -1.0
finite_pose = finiteness(ToolPose)


class TrackedTool(NamedTuple):
    """Where a tracker saw the tool, and when."""

    p: Annotated[Vector, Field("m", "p_WT", (0.0, 0.0, 0.0414))]
    n: Annotated[Vector, Field("1", "n_WT", (0.0, 0.0, 1.0))]
    time: Annotated[float, Field("s", "of the frame, -1 before the first", NEVER)]


class PoseNoise(NamedTuple):
    """What errs in a frame: independent standard normal numbers."""

    place: Annotated[Vector, Field("1", "of the place", (0.0, 0.0, 0.0))]
    turn: Annotated[Vector, Field("1", "of the rotation vector", (0.0, 0.0, 0.0))]


@dataclass
class ToolTrackerParams:
    """Parameters of `ToolTracker`: electromagnetic or through the endoscope."""

    period: float = parameter(0.02, "between frames", "s", least=1e-3, most=1.0)
    latency: float = parameter(0.04, "until it is delivered", "s", least=0, most=1.0)
    noise: float = parameter(
        0.1e-3, "rms error of the place in three dimensions", "m", least=0, most=0.01
    )
    turn: float = parameter(
        math.radians(0.5), "of the axis, about each axis", "rad", least=0, most=0.2
    )


@compiled
def expose(
    c: Any,
    line: np.ndarray,
    measured: TrackedTool,
    time: float,
    tool: ToolPose,
    noise: PoseNoise,
) -> tuple[np.ndarray, TrackedTool]:
    """The delay line with a new frame at its end, and its oldest one."""
    after = np.empty_like(line)
    after[:-7] = line[7:]
    p = along(tool.p, c.noise / math.sqrt(3.0), noise.place)
    n = unit(along(tool.n, c.turn, cross(noise.turn, tool.n)))
    after[-7:-4], after[-4:-1], after[-1] = np.array(p), np.array(n), time
    if not finite_pose(ToolPose(p, n)):
        after[-7:-1], after[-1] = line[-7:-1], line[-1]
    a = after[:7]
    return after, TrackedTool((a[0], a[1], a[2]), (a[3], a[4], a[5]), a[6])


class ToolTracker(StepBlock):
    """Measures the tool's pose.

    Every period a frame is exposed; it is delivered `latency` later, by whole periods
    and one at least. A pose that is no number leaves the last frame.

    Port ``tool`` accepts the true `ToolPose`.
    Port ``noise`` accepts the `PoseNoise`, renewed every period.
    Port ``measured`` emits the last frame delivered, a `TrackedTool`.
    """

    def __init__(self, params: ToolTrackerParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or ToolTrackerParams())
        frames = max(1, math.ceil(params.latency / params.period - 1e-9))
        unseen = np.append([0.0] * (size(TrackedTool) - 1), NEVER)
        self.declare_update(
            expose,
            [packed(params)],
            {"tool": ToolPose, "noise": PoseNoise},
            {"_line": np.tile(unseen, frames), "measured": example(TrackedTool)},
            params.period,
        )
