"""Resection IK: postures for tool poses, reached at a bounded speed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.inverse_kernels import REACHED, solve_tool
from plants.snake.parameters import SnakeParams
from plants.snake.signals import REST, Numbers, Posture, ToolTarget
from systems.common.compiled import compiled, packed
from systems.common.geometry import norm, over
from systems.common.parameter import check, parameter
from systems.common.signal import Field, finiteness
from systems.common.step_block import StepBlock

HOLD = -1
"""Status of an input that is no pose at all."""
finite_target = finiteness(ToolTarget)


class IkStatus(NamedTuple):
    """Whether the target is reached or approached, and if not, why."""

    code: Annotated[
        float, Field("1", "0, a limit of `plants.snake.inverse_kernels`, or -1", 0.0)
    ]


@dataclass
class ResectionIkParams:
    """Parameters of `ResectionIk`."""

    period: float = parameter(0.02, "of the postures", "s", least=1e-3, most=0.1)
    bend_rate: float = parameter(
        1.5, "largest rate of a or b of a ball", "rad/s", least=0.01, most=10.0
    )
    travel_rate: float = parameter(
        0.03, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )


@compiled
def time_between(c: Any, one: Numbers, other: Numbers) -> float:
    """Least time in s from x to another x at full rates, all joints together."""
    most = abs(other[0] - one[0]) / c.travel_rate
    for i in range(1, len(one)):
        most = max(most, abs(other[i] - one[i]) / c.bend_rate)
    return most


class Motion(NamedTuple):
    """How a posture x follows its goal."""

    x: Annotated[Numbers, Field("m, rad", "where it is to be now", REST)]
    goal: Annotated[Numbers, Field("m, rad", "what was last asked for", REST)]
    start: Annotated[Numbers, Field("m, rad", "where the move under way began", REST)]
    elapsed: Annotated[float, Field("s", "time into it", 0.0)]
    duration: Annotated[float, Field("s", "its time; 0 if there is none", 0.0)]


@compiled
def standing(x: Any) -> Motion:
    """No motion, at a posture (7,)."""
    return Motion(x, x, x, 0.0, 0.0)


@compiled
def follow(c: Any, motion: Any, goal: Any) -> Motion:
    """The motion one period later, its postures arrays.

    A goal that moves no faster than the rates allow is met exactly. One that jumps
    starts a move of smooth speed (a quintic, whose peak is 15/8 of its mean) at whose
    end it is met. Both are straight lines in x, which keep the bend's limit if their
    ends do: its cone is convex in (a, b).
    """
    x, start = motion.x, motion.start
    elapsed, duration = motion.elapsed, motion.duration
    if time_between(c, motion.goal, goal) > c.period * (1 + 1e-9):
        start, elapsed = x, 0.0
        duration = 15 / 8 * time_between(c, x, goal)
    if elapsed < duration:
        elapsed = min(elapsed + c.period, duration)
        r = elapsed / duration
        x = start + r * r * r * (10 - 15 * r + 6 * r * r) * (goal - start)
    else:
        most = time_between(c, x, goal)
        x = x + (min(c.period / most, 1.0) if most > 0.0 else 1.0) * (goal - x)
    return Motion(x, goal, start, elapsed, duration)


@compiled
def _step(
    c: Any, motion: Motion, target: ToolTarget
) -> tuple[Motion, Posture, IkStatus]:
    at: Any = np.array(motion.x)
    goal: Any = np.array(motion.goal)
    start: Any = np.array(motion.start)
    now = Motion(at, goal, start, motion.elapsed, motion.duration)
    status, x = HOLD, np.empty(7)
    n, m = norm(target.n), norm(target.n_I)
    if finite_target(target) and n > 0.0 and m > 0.0:
        axes = over(target.n, n), over(target.n_I, m)
        travel = c.travel[0], c.travel[1]
        h, tool, bend = c.half_pitch, c.tool_offset, c.max_bend
        status = solve_tool(target.p, *axes, h, tool, bend, travel, x)
    now = follow(c, now, x) if status == REACHED else standing(now.x)
    return now, Posture(now.x), IkStatus(float(status))


class ResectionIk(StepBlock):
    """Inverse kinematics of the whole robot, tool pose to posture (paper, V.B).

    The two redundant freedoms are the intermediate axis, which the target brings
    along. A pose out of reach, or numbers that are not finite, leave the posture
    where it is. A target that moves slower than the rates allow is met exactly; one
    that jumps is approached smoothly, on a straight line in the modules' angles.

    Port ``target`` accepts the `ToolTarget`.
    Port ``posture`` emits the `Posture` to be reached at the period's end.
    Port ``status`` emits the `IkStatus`.
    """

    def __init__(
        self,
        params: ResectionIkParams | None = None,
        snake: SnakeParams | None = None,
        posture: Sequence[float] = REST,
    ) -> None:
        """Makes the block, starting at a posture (7)."""
        super().__init__()
        params, snake = (
            check(params or ResectionIkParams()),
            check(snake or SnakeParams()),
        )
        x = tuple(map(float, posture))
        constants = packed(
            params,
            travel=np.array(snake.travel, float),
            max_bend=snake.max_bend,
            half_pitch=snake.half_pitch,
            tool_offset=snake.tool_offset,
        )
        self.declare_step(
            _step,
            [constants],
            {"target": ToolTarget},
            Motion(x, x, x, 0.0, 0.0),
            {"posture": Posture, "status": IkStatus},
            params.period,
            timed=False,
        )
