"""Resection IK: postures for tool poses, reached at a bounded speed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.inverse_kernels import REACHED
from plants.snake.inverse_kinematics import tool_posture
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array
from plants.snake.signals import REST, Posture, ToolTarget
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field, flat, view

HOLD = -1
"""Status of an input that is no pose at all."""


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
        2.0, "largest rate of a or b of a ball", "rad/s", least=0.01, most=10.0
    )
    travel_rate: float = parameter(
        0.03, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )


def time_between(one: Array, other: Array, params: ResectionIkParams) -> float:
    """Least time in s from x to another x at full rates, all joints together."""
    rates = [params.travel_rate] + [params.bend_rate] * (len(one) - 1)
    return float((np.abs(other - one) / rates).max())


class Motion(NamedTuple):
    """How a posture x follows its goal."""

    x: Annotated[Array, Field("m, rad", "where it is to be now", REST)]
    goal: Annotated[Array, Field("m, rad", "what was last asked for", REST)]
    start: Annotated[Array, Field("m, rad", "where the move under way began", REST)]
    elapsed: Annotated[float, Field("s", "time into it", 0.0)]
    duration: Annotated[float, Field("s", "its time; 0 if there is none", 0.0)]


def standing(x: Array) -> Motion:
    """No motion, at a posture (7,)."""
    return Motion(x, x, x, 0.0, 0.0)


def follow(motion: Motion, goal: Array, params: ResectionIkParams) -> Motion:
    """The motion one period later.

    A goal that moves no faster than the rates allow is met exactly. One that jumps
    starts a move of smooth speed (a quintic, whose peak is 15/8 of its mean) at whose
    end it is met. Both are straight lines in x, which keep the bend's limit if their
    ends do: its cone is convex in (a, b).
    """
    period, x, start = params.period, motion.x, motion.start
    elapsed, duration = motion.elapsed, motion.duration
    if time_between(motion.goal, goal, params) > period * (1 + 1e-9):
        start, elapsed = x, 0.0
        duration = 15 / 8 * time_between(x, goal, params)
    if elapsed < duration:
        elapsed = min(elapsed + period, duration)
        r = elapsed / duration
        x = start + r * r * r * (10 - 15 * r + 6 * r * r) * (goal - start)
    else:
        most = time_between(x, goal, params)
        x = x + (min(period / most, 1.0) if most > 0.0 else 1.0) * (goal - x)
    return Motion(x, goal, start, elapsed, duration)


class ResectionIk(Block):
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
        self._params = check(params or ResectionIkParams())
        self._snake = check(snake or SnakeParams())
        self._target = self.signal_in("target", ToolTarget)
        self.DeclareDiscreteState(flat(standing(np.array(posture, float))))
        self._next = self.cached(
            "next", self._calc_next, {self.xd_ticket(), self._target.ticket()}
        )
        ticket = {self._next.ticket()}
        self.signal_out("posture", Posture, self._calc_posture, ticket)
        self.signal_out("status", IkStatus, self._calc_status, ticket)
        self.update_every(self._params.period, self._update)

    def _calc_next(self, context: Any) -> tuple[Motion, int]:
        """The motion one period later, and the status."""
        motion = view(Motion, np.array(context.get_discrete_state(0).value()))
        try:
            x, status = tool_posture(self._target.Eval(context), self._snake)
        except ValueError:
            return standing(motion.x), HOLD
        if status != REACHED:
            return standing(motion.x), status
        return follow(motion, np.array(x), self._params), REACHED

    def _calc_posture(self, context: Any) -> Array:
        motion, _ = self._next.Eval(context)
        return motion.x

    def _calc_status(self, context: Any) -> list[float]:
        _, status = self._next.Eval(context)
        return [float(status)]

    def _update(self, context: Any) -> Array:
        motion, _ = self._next.Eval(context)
        return flat(motion)
