"""Procedure player: plays a plan as a smooth stream of tool poses."""

from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plants.snake.kinematics import POINTS, corners, link_axis
from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolPose, ToolTarget
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field, flat, vector


class Progress(NamedTuple):
    """How far a plan has been played."""

    posture: Annotated[float, Field("1", "the one last reached", 0.0)]


@dataclass
class ProcedurePlayerParams:
    """Parameters of `ProcedurePlayer`."""

    lead: float = parameter(
        0.02,
        "how far ahead of time `target` is, the control period",
        "s",
        least=1e-3,
        most=0.1,
    )
    bend_rate: float = parameter(
        1.2, "largest rate of a or b of a ball", "rad/s", least=0.01, most=10.0
    )
    travel_rate: float = parameter(
        0.010, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )
    dwell: float = parameter(
        0.3, "at the beginning and at the end", "s", above=0.0, most=60.0
    )


def schedule(x: NDArray[np.float64], params: ProcedurePlayerParams) -> NDArray:
    """When each posture is reached, in s, (n,): instants of control, `lead` apart.

    Args:
        x: Postures (n, 7) as s, a1, b1, ..., b3.
        params: Rates.
    """
    step = np.abs(np.diff(x, axis=0))
    if len(step) == 0:
        return np.array([params.dwell])
    time = np.maximum(
        step[:, 0] / params.travel_rate, step[:, 1:].max(axis=1) / params.bend_rate
    )
    # Whole control periods, so that no corner of the path falls between two instants.
    time = np.maximum(np.ceil(time / params.lead - 1e-6), 1.0) * params.lead
    start = math.ceil(params.dwell / params.lead) * params.lead
    return start + np.concatenate([[0.0], np.cumsum(time)])


def posture_at(
    x: NDArray[np.float64], times: NDArray[np.float64], time: float
) -> NDArray[np.float64]:
    """The posture (7,) at a time in s, of postures (n, 7) reached at times (n,)."""
    n = int(np.searchsorted(times, time))
    if n == 0 or n == len(times):
        return x[min(n, len(x) - 1)]
    share = (time - times[n - 1]) / (times[n] - times[n - 1])
    between: NDArray[np.float64] = x[n - 1] + share * (x[n] - x[n - 1])
    return between


def target_of(x: NDArray[np.float64], snake: SnakeParams) -> ToolTarget:
    """The tool's pose of a posture (7,), with its intermediate axis."""
    c, h = np.empty((POINTS, 3)), snake.half_pitch
    corners(x, h, snake.tool_offset, c)
    return ToolTarget(vector(c[-1]), link_axis(c, 5, h), link_axis(c, 3, h))


class ProcedurePlayer(Block):
    """Plays the postures of a plan, at the rates the robot can keep.

    Between two postures the way is straight in the modules' angles, as it was
    checked. The intermediate axis goes along, so the inverse kinematics finds the
    planned posture again.

    Port ``target`` emits the `ToolTarget`, ``lead`` ahead of time.
    Port ``reference`` emits the `ToolPose` of this instant.
    Port ``progress`` emits the `Progress`.
    """

    def __init__(
        self,
        params: ProcedurePlayerParams | None = None,
        snake: SnakeParams | None = None,
        postures: ArrayLike | None = None,
        first: int = 0,
    ) -> None:
        """Makes the block for a plan.

        Args:
            params: Rates.
            snake: Geometry.
            postures: As s, a1, b1, ..., b3, (n, 7); a short bend if None.
            first: Index of the posture at which the robot stands: those before it
                have been played.
        """
        super().__init__()
        self._params = check(params or ProcedurePlayerParams())
        self._snake = check(snake or SnakeParams())
        if postures is None:
            postures = [[0.0] * 7, [0.002, 0.0, 0.1, 0.0, 0.1, 0.2, 0.1]]
        self._x = np.array(postures, float)
        if self._x.ndim != 2 or self._x.shape[1] != 7 or len(self._x) == 0:
            raise ValueError(
                f"postures have shape {self._x.shape}, expected (n, 7) with n > 0"
            )
        if not 0 <= first < len(self._x):
            raise ValueError(f"first={first}: expected 0 to {len(self._x) - 1}")
        self._first, self._x = first, self._x[first:]
        self._times = schedule(self._x, self._params)
        ticket = {self.time_ticket()}
        self.signal_out("target", ToolTarget, self._calc_target, ticket)
        self.signal_out("reference", ToolPose, self._calc_reference, ticket)
        self.signal_out("progress", Progress, self._calc_progress, ticket)

    @property
    def duration(self) -> float:
        """Of the whole plan in s, both dwells included."""
        return float(self._times[-1]) + self._params.dwell

    @property
    def times(self) -> NDArray[np.float64]:
        """When each posture is reached in s, (n,); 0 for those played before."""
        return np.concatenate([np.zeros(self._first), self._times])

    def target(self, time: float) -> ToolTarget:
        """The tool's pose at a time in s."""
        return target_of(posture_at(self._x, self._times, time), self._snake)

    def _calc_target(self, context: Any) -> np.ndarray:
        return flat(self.target(context.get_time() + self._params.lead))

    def _calc_reference(self, context: Any) -> np.ndarray:
        target = self.target(context.get_time())
        return flat(ToolPose(target.p, target.n))

    def _calc_progress(self, context: Any) -> list[float]:
        reached = int(np.searchsorted(self._times, context.get_time() + 1e-9, "right"))
        return [float(self._first + max(reached - 1, 0))]
