"""Snake task: out of the tube, into the organ, along the plan, and back.

The way has four legs, on a clock of its own: out of the tube, straight in its frame C;
over to the organ's frame E, still outside the organ; in through the entry while the
tube advances; and to where the plan begins. From there the plan's postures are played.
A retreat straightens the last module: what it swept lies about the intermediate axis,
so the tool goes to the middle of what it has itself made free.

All postures but those of the first leg are meant in E. What is sent is the tool's pose
in C, where tube and organ will be when it is reached.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolPose, ToolTarget
from plants.snake.tool_target import seen_from, target_of
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import along, pose_of, row_of
from systems.common.parameter import check, parameter
from systems.common.signal import flat, reader, size, view, writer
from systems.keyhole.phases import Phases
from systems.keyhole.signals import Phase, SnakeStatus, TubePose
from systems.resection.wires.procedure_player import (
    ProcedurePlayerParams,
    posture_at,
    schedule,
)
from systems.sensing.organ_estimator import OrganMotion

Floats = np.ndarray
_ALONG = (0.0, 0.0, 1.0)
read_tube, read_target = reader(TubePose), reader(ToolTarget)
write_target = writer(ToolTarget)


@dataclass
class SnakeTaskParams:
    """Parameters of `SnakeTask`."""

    speed: float = parameter(
        0.02, "of the tool on its way", "m/s", above=0.0, most=0.05
    )
    change: float = parameter(
        0.8, "time from the tube's frame to the organ's", "s", above=0.0, most=10.0
    )
    bend_rate: float = parameter(
        0.4, "on the way to the plan's beginning", "rad/s", above=0.0, most=5.0
    )
    follow: bool = parameter(
        True, "whether it makes up for tube and organ; else C is taken for E"
    )
    retreat: float = parameter(
        0.15, "time in which the tool draws back", "s", above=0.0, most=5.0
    )
    back: float = parameter(
        2.0, "time in which it comes back", "s", above=0.0, most=60.0
    )
    rewind: float = parameter(
        3.0, "how much faster than the plan it goes home", above=0.0, most=10.0
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0.0, most=0.1)


class Way(NamedTuple):
    """Clocks of the way and of the plan in s, and share of the retreat."""

    way: float
    clock: float
    retreat: float


def smooth(share: float) -> float:
    """A share in [0, 1] with soft ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled
def in_channel(
    target: Floats, E: Floats, p_WE: Floats, tube: Floats, gap: float
) -> Floats:
    """A target given in E, in C; all as elements.

    Args:
        target: Of a `ToolTarget`.
        E: x and z axes of E in W, (2, 3).
        p_WE: The entry.
        tube: Of a `TubePose`.
        gap: From the tube's end to C.
    """
    at = read_tube(tube)
    C = pose_of(along(at.p, gap, at.z), at.x, at.z)
    return write_target(
        seen_from(read_target(target), pose_of(p_WE, row_of(E, 0), row_of(E, 1)), C)
    )


@compiled
def target_elements(x: Floats, h: float, tool: float) -> Floats:
    """The elements of the `ToolTarget` of a posture x (7,)."""
    return write_target(target_of(x, h, tool))


@dataclass
class Plan:
    """What the tool is to do: postures in E, and when each is reached.

    Attributes:
        postures: As s, a1, b1, ..., b3, (n, 7).
        times: In s, (n,), rising.
        turn: The plan is played again and again from this time on, in s; once if
            negative.
    """

    postures: Floats
    times: Floats
    turn: float = -1.0

    @property
    def end(self) -> float:
        """When it is done, in s; never if it is played again."""
        return float(self.times[-1]) if self.turn < 0.0 else np.inf

    def posture(self, clock: float) -> Floats:
        """The posture (7,) at a time of its clock in s."""
        last = float(self.times[-1])
        if self.turn >= 0.0 and clock > last:
            clock = self.turn + (clock - self.turn) % (last - self.turn)
        return posture_at(self.postures, self.times, clock)


def planned(postures: ArrayLike, player: ProcedurePlayerParams) -> Plan:
    """A session's plan at the rates of a player."""
    x = np.array(postures, float)
    return Plan(x, schedule(x, player))


class SnakeTask(Block):
    """What the snake is to do.

    Port ``phase`` accepts the operation's `Phase`.

    Port ``tube`` accepts the `TubePose`, a period ahead.

    Port ``organ`` accepts the entry's `OrganMotion`, a period ahead.

    Port ``target`` emits the `ToolTarget` in C to be reached at the period's end.

    Port ``reference`` emits the `ToolPose` in E of this instant.

    Port ``status`` emits the `SnakeStatus`.
    """

    def __init__(
        self,
        params: SnakeTaskParams | None = None,
        snake: SnakeParams | None = None,
        plan: Plan | None = None,
        axes: Sequence[Sequence[float]] = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        gap: float = 0.040,
        standoff: float = 0.053,
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            snake: Geometry.
            plan: What to play; a short stroke if None.
            axes: x and z axes of E in W.
            gap: From the tube's end to C, in m.
            standoff: Of the tube's station from the entry, in m.
        """
        super().__init__()
        p = self._p = check(params or SnakeTaskParams())
        self._snake = check(snake or SnakeParams())
        if plan is None:
            straight = np.zeros((2, 7))
            straight[:, 0] = -0.035, -0.030
            plan = Plan(straight, np.array([0.3, 1.3]))
        self._plan, self._gap = plan, gap
        self._axes = np.array(axes, float)
        length = 3 * self._snake.straight_module + self._snake.tool_offset
        self._length, self._advance = length, standoff - gap
        # Translations in C: within the tube, just out of it.
        self._inside = -gap - length - self._snake.tool_radius - 1e-3
        self._outside = -gap + 1e-3
        begin = plan.posture(0.0)
        # Translations in E: at the tube's end at its station, and at the entry.
        self._before = self._outside - self._advance
        self._entry = min(float(begin[0]), self._outside)
        straight = np.array([self._entry, *np.zeros(6)])
        bend = float(np.abs(begin - straight)[1:].max()) / p.bend_rate
        legs = [
            (self._outside - self._inside) / p.speed,
            p.change,
            1.5 * max(self._entry - self._before, 1e-3) / p.speed,
            1.5 * max(bend, abs(float(begin[0]) - self._entry) / p.speed),
        ]
        self._ends = np.cumsum(legs)
        self._straight, self._begin = straight, begin
        self._phase = self.signal_in("phase", Phase)
        self._tube = self.signal_in("tube", TubePose)
        self._organ = self.signal_in("organ", OrganMotion)
        self.DeclareDiscreteState(flat(Way(0.0, 0.0, 0.0)))
        held = np.array([0.0, 0.0, self._inside + length, *_ALONG, *_ALONG])
        self._held = self.DeclareDiscreteState(held)
        state, phase = {self.xd_ticket()}, {self._phase.ticket()}
        reads = state | phase | {self._tube.ticket(), self._organ.ticket()}
        self._next = self.cached("next", self._calc_next, state | phase)
        self._target = self.cached("target", self._calc_target, reads)
        self.signal_out(
            "target", ToolTarget, self._target.Eval, {self._target.ticket()}
        )
        self.signal_out("reference", ToolPose, self._calc_reference, state)
        self.signal_out("status", SnakeStatus, self._calc_status, state | phase)
        self.update_every(
            p.period,
            lambda context: [self._next.Eval(context), self._target.Eval(context)],
        )

    @property
    def inside(self) -> list[float]:
        """The posture (7) within the tube, in C: the robot's first."""
        return [self._inside, *[0.0] * 6]

    @property
    def time(self) -> float:
        """Least time in s from the gate to the plan's end, and home again."""
        return 2.0 * float(self._ends[-1]) + self._plan.end

    def _way(self, context: Any) -> Way:
        return Way(*context.get_discrete_state(0).value().tolist())

    def _calc_next(self, context: Any) -> Floats:
        """The way one period later."""
        p, (way, clock, retreat) = self._p, self._way(context)
        code = view(Phase, self._phase.Eval(context)).code
        dt, whole = p.period, float(self._ends[-1])
        if np.isnan(code):  # as if it were stopped
            code = Phases.STOPPED
        drawn = code == Phases.STOPPED
        retreat += dt / p.retreat if drawn else -dt / p.back
        retreat = min(max(retreat, 0.0), 1.0)
        if code == Phases.RESECT and retreat == 0.0:
            way, more = min(way + dt, whole), dt if way >= whole else 0.0
            clock = min(clock + more, self._plan.end)
        if code == Phases.RETRACT and retreat == 0.0:
            if clock >= self._plan.end:
                clock = 0.0 if way < whole else clock
                way = max(way - dt, 0.0)
            elif clock > 0.0:
                clock = max(clock - p.rewind * dt, 0.0)
            else:
                way = max(way - dt, 0.0)
        return np.array([way, clock, retreat])

    def _posture(self, now: Way) -> Floats:
        """The posture in E from the third leg on."""
        _, over, entered, whole = self._ends
        if now.way >= whole:
            x = self._plan.posture(now.clock).copy()
        elif now.way > entered:
            share = smooth((now.way - entered) / (whole - entered))
            x = self._straight + share * (self._begin - self._straight)
        else:
            share = smooth((now.way - over) / (entered - over))
            x = np.zeros(7)
            x[0] = self._before + share * (self._entry - self._before)
        x[5:] *= 1.0 - smooth(now.retreat)
        return x

    def _calc_target(self, context: Any) -> Floats:
        tube, organ = self._tube.Eval(context), self._organ.Eval(context)
        held: Floats = context.get_discrete_state(self._held).value()
        if not (np.isfinite(tube).all() and np.isfinite(organ).all()):
            return held.copy()
        now = Way(*self._next.Eval(context).tolist())
        out, over = self._ends[:2]
        z = self._inside + self._p.speed * min(now.way, out) + self._length
        in_tube = np.array([0.0, 0.0, z, *_ALONG, *_ALONG])
        if now.way <= out:
            return in_tube
        p_WE, E = view(OrganMotion, organ).p.copy(), self._axes
        if not self._p.follow:
            at = view(TubePose, tube)
            p_WE, E = at.p + self._gap * at.z, np.stack([E[0], at.z])
        told = in_channel(self._tool(now), E, p_WE, tube.copy(), self._gap)
        share = smooth((now.way - out) / (over - out))
        return in_tube + share * (told - in_tube)

    def _calc_reference(self, context: Any) -> Floats:
        return self._tool(self._way(context))[: size(ToolPose)]

    def _tool(self, now: Way) -> Floats:
        """The elements of the `ToolTarget` in E, from the third leg on."""
        snake, x = self._snake, self._posture(now)
        tool: Floats = target_elements(x, snake.half_pitch, snake.tool_offset)
        return tool

    def _calc_status(self, context: Any) -> Floats:
        now = self._way(context)
        over, entered = self._ends[1:3]
        share = (now.way - over) / (entered - over)
        rate = 0.0
        if 0.0 < share < 1.0:
            slope = 6.0 * share * (1.0 - share) / (entered - over)
            rate = self._advance * slope
            code = view(Phase, self._phase.Eval(context)).code
            if code == Phases.RETRACT:
                rate = -rate
            elif code != Phases.RESECT:
                rate = 0.0
        return np.array(
            [
                now.way / float(self._ends[-1]),
                self._advance * smooth(share),
                rate,
                now.clock,
                min(self._plan.end - now.clock, 1e6),
                now.retreat,
            ]
        )
