"""Resection IK: postures for tool poses, reached at a bounded speed."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from plants.snake.inverse_kinematics import REACHED, tool_posture
from plants.snake.parameters import SnakeParams
from systems.common.block import Block
from systems.common.parameter import check, parameter

HOLD = -1
"""Status of an input that is no pose at all."""


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


def universal(posture: Sequence[float]) -> list[float]:
    """(s, a1, b1, ..., b3) of a posture (s, alpha1, beta1, ..., beta3)."""
    x = [posture[0]]
    for alpha, beta in zip(posture[1::2], posture[2::2], strict=True):
        sb = math.sin(beta)
        x.append(math.atan2(-sb * math.sin(alpha), math.cos(beta)))
        x.append(math.asin(sb * math.cos(alpha)))
    return x


def from_universal(x: Sequence[float]) -> list[float]:
    """The posture of (s, a1, b1, ..., b3)."""
    q = [x[0]]
    for a, b in zip(x[1::2], x[2::2], strict=True):
        along, across = math.sin(b), -math.sin(a) * math.cos(b)
        q.append(math.atan2(across, along))
        q.append(
            math.atan2(math.hypot(along, across), math.cos(a) * math.cos(b)),
        )
    return q


def time_between(
    one: Sequence[float], other: Sequence[float], params: ResectionIkParams
) -> float:
    """Least time in s from x to another x at full rates, all joints together."""
    return max(
        abs(other[0] - one[0]) / params.travel_rate,
        *(
            abs(g - n) / params.bend_rate
            for n, g in zip(one[1:], other[1:], strict=True)
        ),
    )


def between(one: Sequence[float], other: Sequence[float], share: float) -> list[float]:
    """The point at a share of the straight line from x to another x.

    It keeps the bend's limit if its ends do: the limit's cone is convex in (a, b).
    """
    return [n + share * (g - n) for n, g in zip(one, other, strict=True)]


@dataclass
class Motion:
    """How a posture follows its goal, all in coordinates x = (s, a1, b1, ..., b3).

    Attributes:
        x: Where the posture is to be now, (7).
        goal: What it was last asked for, (7).
        start: Where the move under way began, (7).
        elapsed: Time into it in s.
        duration: Its time in s; 0 if there is none.
    """

    x: list[float]
    goal: list[float]
    start: list[float]
    elapsed: float = 0.0
    duration: float = 0.0

    def vector(self) -> list[float]:
        """As a state vector (23)."""
        return [*self.x, *self.goal, *self.start, self.elapsed, self.duration]

    @staticmethod
    def of_vector(v: list[float]) -> "Motion":
        """From a state vector (23)."""
        return Motion(v[:7], v[7:14], v[14:21], v[21], v[22])

    def hold(self) -> "Motion":
        """Stands still from now on."""
        return Motion(self.x, self.x, self.x)

    def follow(self, goal: list[float], params: ResectionIkParams) -> "Motion":
        """The motion one period later.

        A goal that moves no faster than the rates allow is met exactly. One that
        jumps starts a move of smooth speed (a quintic, whose peak is 15/8 of its
        mean) at whose end it is met.
        """
        period = params.period
        start, elapsed, duration = self.start, self.elapsed, self.duration
        if time_between(self.goal, goal, params) > period * (1 + 1e-9):
            start, elapsed = self.x, 0.0
            duration = 15 / 8 * time_between(self.x, goal, params)
        if elapsed < duration:
            elapsed = min(elapsed + period, duration)
            r = elapsed / duration
            x = between(start, goal, r * r * r * (10 - 15 * r + 6 * r * r))
        else:
            most = time_between(self.x, goal, params)
            x = between(self.x, goal, min(period / most, 1.0) if most > 0.0 else 1.0)
        return Motion(x, goal, start, elapsed, duration)


class ResectionIk(Block):
    """Inverse kinematics of the whole robot, tool pose to posture (paper, V.B).

    The two redundant freedoms are the intermediate axis, which the target brings
    along. A pose out of reach, or numbers that are not finite, leave the posture
    where it is. A target that moves slower than the rates allow is met exactly; one
    that jumps is approached smoothly, on a straight line in the modules' angles.

    Port ``target`` accepts p_WT [m], tool axis n_WT and intermediate axis n_WI,
    channel frame W (9). The axes need not be unit vectors.

    Port ``posture`` emits s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7), to be
    reached at the period's end.

    Port ``status`` emits 0 if the target is reached or approached, else the limit
    that stops it (`plants.snake.inverse_kinematics`), or -1 for no pose at all (1).
    """

    def __init__(
        self,
        params: ResectionIkParams | None = None,
        snake: SnakeParams | None = None,
        posture: Sequence[float] = (0.0,) * 7,
    ) -> None:
        """Makes the block, starting at a posture (7)."""
        super().__init__()
        self._params = check(params or ResectionIkParams())
        self._snake = check(snake or SnakeParams())
        straight = 3 * self._snake.straight_module + self._snake.tool_offset
        self._target = self.vector_in(
            "target", [0.0, 0.0, straight, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]
        )
        x = universal(posture)
        self.DeclareDiscreteState(Motion(x, x, x).vector())
        self._next = self.cached(
            "next", self._calc_next, {self.xd_ticket(), self._target.ticket()}
        )
        ticket = {self._next.ticket()}
        self.vector_out("posture", 7, self._calc_posture, ticket)
        self.vector_out("status", 1, self._calc_status, ticket)
        self.update_every(self._params.period, self._update)

    def _calc_next(self, context: Any) -> tuple[Motion, int]:
        """The motion one period later, and the status."""
        state = context.get_discrete_state(0).value().tolist()
        motion = Motion.of_vector(state)
        try:
            q, status = tool_posture(self._target.Eval(context), self._snake)
        except ValueError:
            return motion.hold(), HOLD
        if status != REACHED:
            return motion.hold(), status
        return motion.follow(universal(q), self._params), REACHED

    def _calc_posture(self, context: Any) -> Sequence[float]:
        return from_universal(self._next.Eval(context)[0].x)

    def _calc_status(self, context: Any) -> Sequence[float]:
        return [float(self._next.Eval(context)[1])]

    def _update(self, context: Any) -> Sequence[float]:
        return self._next.Eval(context)[0].vector()
