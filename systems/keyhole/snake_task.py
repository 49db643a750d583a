"""Snake task: out of the tube, into the organ, along the plan, and back.

The way has four legs, on a clock of its own: out of the tube, straight in its frame C;
over to the organ's frame E, still outside the organ; in through the entry while the
tube advances; and to where the plan begins. From there the plan's postures are played.
A retreat goes back along the plan, quicker than it came: there is no posture on it to
which the tissue has not made room.

All postures but those of the first leg are meant in E. What is sent is the tool's pose
in C, where tube and organ will be when it is reached.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.inverse_kernels import REACHED, solve_tool
from plants.snake.kinematics import POINTS, corners
from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolPose, ToolTarget
from plants.snake.tool_target import seen_from, target_of
from plants.tissue.tissue_carver import Cutting
from systems.common.block import VectorInput
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    Pose,
    along,
    inwards,
    norm,
    outwards,
    plus,
    pose_of,
    row_of,
    sub,
)
from systems.common.parameter import check, parameter
from systems.common.signal import finiteness, flat, reader, size, writer
from systems.common.step_block import StepBlock
from systems.keyhole.phases import Phases
from systems.keyhole.signals import BodyDeviation, Phase, SnakeStatus, TubePose
from systems.resection.wires.procedure_player import (
    ProcedurePlayerParams,
    Profile,
    posture_at,
    profile,
)
from systems.sensing.organ_estimator import OrganMotion

Floats = np.ndarray
_ALONG = (0.0, 0.0, 1.0)
FAR = 0.1
"""Deviation in m of a body that cannot be where it should."""
read_tube, read_organ = reader(TubePose), reader(OrganMotion)
finite_tube, finite_organ = finiteness(TubePose), finiteness(OrganMotion)
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
        0.25, "of the plan, that the tool goes back at a stop", "s", above=0, most=60
    )
    rewind: float = parameter(
        2.5, "how much faster than the plan it goes back", above=0.0, most=10.0
    )
    turnabout: float = parameter(
        40.0, "acceleration of the plan's clock", "1/s", above=0.0, most=1e3
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0.0, most=0.1)


class Way(NamedTuple):
    """Clocks of the way and of the plan in s, the latter's rate, and its farthest."""

    way: float
    clock: float
    rate: float
    mark: float


@compiled
def smooth(share: float) -> float:
    """A share in [0, 1] with soft ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@compiled
def in_channel(target: ToolTarget, E: Pose, tube: TubePose, gap: float) -> ToolTarget:
    """A target given in E, in C, which stands `gap` beyond the tube's end."""
    C = pose_of(along(tube.p, gap, tube.z), tube.x, tube.z)
    return seen_from(target, E, C)


@compiled
def posture_on(plan: Any, turn: float, clock: float) -> Any:
    """The posture (7,) of a `Plan`, its arrays and turn, at a time in s."""
    x, times, full, v, waits, ramp = plan
    last = times[-1]
    if turn >= 0.0 and clock > last:
        clock = turn + (clock - turn) % (last - turn)
    return posture_at(x, times, full, v, waits, ramp, clock)


@dataclass
class Plan:
    """What the tool is to do: postures in E, and how they are played.

    Attributes:
        postures: As s, a1, b1, ..., b3, (n, 7).
        profile: When each is reached, and how fast.
        ramp: Time from rest to full speed, in s.
        turn: The plan is played again and again from this time on, in s; once if
            negative.
    """

    postures: Floats
    profile: Profile
    ramp: float = 1.0
    turn: float = -1.0

    @property
    def end(self) -> float:
        """When it is done, in s; never if it is played again."""
        return float(self.profile.times[-1]) if self.turn < 0.0 else np.inf

    @property
    def arrays(self) -> Any:
        """What `posture_at` takes before the time."""
        return (self.postures, *self.profile, self.ramp)

    def posture(self, clock: float) -> Floats:
        """The posture (7,) at a time of its clock in s."""
        posture: Floats = posture_on(self.arrays, self.turn, clock)
        return posture


def planned(postures: ArrayLike, player: ProcedurePlayerParams) -> Plan:
    """A session's plan as its player plays it."""
    x = np.array(postures, float)
    return Plan(x, profile(x, player), max(player.turn, player.lead))


def evenly(postures: Floats, times: Floats, turn: float = -1.0) -> Plan:
    """Postures (n, 7) at given times in s (n,), at an even speed between two."""
    n = len(times)
    even = Profile(times, np.zeros(n - 1), np.zeros(n), np.zeros(n))
    return Plan(postures, even, turn=turn)


@compiled
def _go(
    c: Any, now: Way, phase: Phase, organ: OrganMotion
) -> tuple[Way, SnakeStatus, Cutting]:
    """The way one period later, the status, and whether the tool has power."""
    way, clock, rate, mark = now
    code = float(Phases.STOPPED.value) if isnan(phase.code) else phase.code
    if code == Phases.RESECT.value and organ.alarm != 0.0:  # the phase comes later
        code = float(Phases.STOPPED.value)
    dt, whole = c.period, c.ends[3]
    back = max(mark - c.retreat, 0.0)
    wanted = 0.0
    if code == Phases.RESECT.value:
        if way >= whole:
            wanted = 1.0
        way = min(way + dt, whole)
    elif code == Phases.STOPPED.value and clock > back:
        wanted = -c.rewind
    elif code == Phases.RETRACT.value:
        if clock >= c.end:
            clock = mark = 0.0 if way < whole else clock
            way = max(way - dt, 0.0)
        elif clock > 0.0:
            wanted = -c.rewind
        else:
            way = max(way - dt, 0.0)
    rate += min(max(wanted - rate, -c.turnabout * dt), c.turnabout * dt)
    least = back if code == Phases.STOPPED.value else 0.0
    after = min(max(clock + rate * dt, min(least, clock)), c.end)
    if after == clock:
        rate = 0.0
    clock, mark = after, max(mark, after)
    drawn = min(max(mark - now.clock, 0.0) / max(mark - back, 1e-9), 1.0)
    if code != Phases.STOPPED.value:
        drawn = 0.0
    elif back >= mark:
        drawn = 1.0
    over, entered = c.ends[1], c.ends[2]
    share = (now.way - over) / (entered - over)
    speed = 0.0
    if 0.0 < share < 1.0 and way != now.way:
        speed = c.advance * 6.0 * share * (1.0 - share) / (entered - over)
        if way < now.way:
            speed = -speed
    cutting = Cutting(1.0 if code == Phases.RESECT.value else 0.0)
    status = SnakeStatus(
        now.way / whole,
        c.advance * smooth(share),
        speed,
        now.clock,
        min(c.end - now.clock, 1e6),
        drawn,
    )
    return Way(way, clock, rate, mark), status, cutting


@compiled
def _tool(c: Any, plan: Any, now: Way) -> ToolTarget:
    """The tool in E, from the third leg on."""
    over, entered, whole = c.ends[1], c.ends[2], c.ends[3]
    x: Any = np.zeros(7)
    if now.way >= whole:
        x = posture_on(plan, c.turn, now.clock)
    elif now.way > entered:
        share = smooth((now.way - entered) / (whole - entered))
        x[0] = c.entry
        x += share * (c.begin - x)
    else:
        x[0] = c.before + smooth((now.way - over) / (entered - over)) * (
            c.entry - c.before
        )
    return target_of(x, c.half_pitch, c.tool_offset)


@compiled
def body_deviation(
    x: Floats, C: Pose, E: Pose, h: float, tool: float, bend: float
) -> float:
    """How far the body in the organ is from where a posture has it, in m.

    The inverse kinematics keeps tool and intermediate axis where they are to be in E,
    so what lies before them bends otherwise once C and E are apart.

    Args:
        x: The posture in E, (7,).
        C: The channel.
        E: The entry.
        h: Half the pitch.
        tool: The tool's offset.
        bend: Largest of a ball.
    """
    a, b, q = np.empty((POINTS, 3)), np.empty((POINTS, 3)), np.empty(7)
    corners(x, h, tool, a)
    p, n, m = seen_from(target_of(x, h, tool), E, C)
    if solve_tool(p, n, m, h, tool, bend, (-1.0, 1.0), q) != REACHED:
        return FAR
    corners(q, h, tool, b)
    most, before = 0.0, (0.0, 0.0, 0.0)
    for i in range(POINTS - 1):
        in_W = plus(C.p, outwards(C, row_of(b, i)))
        off = sub(inwards(E, sub(in_W, E.p)), row_of(a, i))
        if a[i, 2] > 0.0:
            if i > 0 and a[i - 1, 2] < 0.0:  # where the body passes the entry
                share = -a[i - 1, 2] / (a[i, 2] - a[i - 1, 2])
                most = norm(along(before, share, sub(off, before)))
            most = max(most, norm(off))
        before = off
    return most


@compiled
def _aim(
    constants: Floats, plan: Any, way: Floats, held: Floats, tube: Floats, organ: Floats
) -> tuple[Floats, float]:
    """The elements of the target in C, and how far the body is from the plan."""
    c, at, entry = constants[0], read_tube(tube), read_organ(organ)
    if not (finite_tube(at) and finite_organ(entry)):
        return held.copy(), FAR
    now, out, over = Way(way[0], way[1], way[2], way[3]), c.ends[0], c.ends[1]
    z = c.inside + c.speed * min(now.way, out) + c.length
    in_tube = write_target(ToolTarget((0.0, 0.0, z), _ALONG, _ALONG))
    E = pose_of(entry.p, row_of(c.axes, 0), row_of(c.axes, 1))
    C = pose_of(along(at.p, c.gap, at.z), at.x, at.z)
    if c.follow == 0.0:
        E = pose_of(C.p, E.x, at.z)
    x = posture_on(plan, c.turn, now.clock)
    away = body_deviation(x, C, E, c.half_pitch, c.tool_offset, c.max_bend)
    if now.way <= out:
        return in_tube, away
    told = write_target(in_channel(_tool(c, plan, now), E, at, c.gap))
    share = smooth((now.way - out) / (over - out))
    return in_tube + share * (told - in_tube), away


@compiled
def _reference(constants: Floats, plan: Any, way: Floats) -> Floats:
    """The elements of the tool's target in E."""
    return write_target(_tool(constants[0], plan, Way(way[0], way[1], way[2], way[3])))


class SnakeTask(StepBlock):
    """What the snake is to do.

    Port ``phase`` accepts the operation's `Phase`.

    Port ``tube`` accepts the `TubePose`, a period ahead.

    Port ``organ`` accepts the entry's `OrganMotion`, a period ahead.

    Port ``target`` emits the `ToolTarget` in C to be reached at the period's end.

    Port ``reference`` emits the `ToolPose` in E of this instant.

    Port ``status`` emits the `SnakeStatus`.

    Port ``cutting`` emits whether the tool has power, `Cutting`: in RESECT alone.

    Port ``deviation`` emits the `BodyDeviation` of the posture that is next.
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
        p, snake = check(params or SnakeTaskParams()), check(snake or SnakeParams())
        if plan is None:
            straight = np.zeros((2, 7))
            straight[:, 0] = -0.035, -0.030
            plan = evenly(straight, np.array([0.3, 1.3]))
        length = 3 * snake.straight_module + snake.tool_offset
        advance = standoff - gap
        # Translations in C: within the tube, just out of it.
        self._inside, outside = -gap - length - snake.tool_radius - 1e-3, -gap + 1e-3
        begin = np.array(plan.postures[0])
        # Translations in E: at the tube's end at its station, and at the entry.
        before, entry = outside - advance, min(float(begin[0]), outside)
        bend = float(np.abs(begin[1:]).max()) / p.bend_rate
        legs = [
            (outside - self._inside) / p.speed,
            p.change,
            1.5 * max(entry - before, 1e-3) / p.speed,
            1.5 * max(bend, abs(float(begin[0]) - entry) / p.speed),
        ]
        ends = np.cumsum(legs)
        self._least = 2.0 * float(ends[-1]) + plan.end
        self._constants = packed(
            p,
            ends=ends,
            axes=np.array(axes, float),
            begin=begin,
            inside=self._inside,
            before=before,
            entry=entry,
            length=length,
            advance=advance,
            gap=gap,
            end=plan.end,
            turn=plan.turn,
            half_pitch=snake.half_pitch,
            tool_offset=snake.tool_offset,
            max_bend=snake.max_bend,
        )
        self._plan = plan.arrays
        self._tube = self.signal_in("tube", TubePose)
        gives = [Way, SnakeStatus, Cutting]
        told = {"phase": Phase, "organ": OrganMotion}
        go, on = self._runner(_go, [self._constants], [Way], told, gives, False, {})
        self._organ = VectorInput(self.GetInputPort("organ"))
        self.DeclareDiscreteState(flat(Way(0.0, 0.0, 0.0, 0.0)))
        held = ToolTarget((0.0, 0.0, self._inside + length), _ALONG, _ALONG)
        self._held = self.DeclareDiscreteState(flat(held))
        state = {self.xd_ticket()}
        self._next = self.cached("next", go, state | on)
        reads = {*state, *on, self._tube.ticket()}
        self._target = self.cached("target", self._calc_target, reads)
        aimed = {self._target.ticket()}
        self.signal_out("target", ToolTarget, self._calc_aim, aimed)
        self.signal_out("deviation", BodyDeviation, self._calc_deviation, aimed)
        self.signal_out("reference", ToolPose, self._calc_reference, state)
        last = size(Way)
        self._emit(self._next, {"status": SnakeStatus, "cutting": Cutting}, last)
        self.update_every(
            p.period,
            lambda context: [
                self._next.Eval(context)[:last],
                self._calc_aim(context),
            ],
        )

    @property
    def inside(self) -> list[float]:
        """The posture (7) within the tube, in C: the robot's first."""
        return [self._inside, *[0.0] * 6]

    @property
    def time(self) -> float:
        """Least time in s from the gate to the plan's end, and home again."""
        return self._least

    def _calc_aim(self, context: Any) -> Floats:
        target: Floats
        target, _ = self._target.Eval(context)
        return target

    def _calc_deviation(self, context: Any) -> list[float]:
        _, away = self._target.Eval(context)
        return [away]

    def _calc_target(self, context: Any) -> tuple[Floats, float]:
        return _aim(
            self._constants,
            self._plan,
            self._next.Eval(context),
            context.get_discrete_state(self._held).value(),
            self._tube.Eval(context),
            self._organ.Eval(context),
        )

    def _calc_reference(self, context: Any) -> Floats:
        way = context.get_discrete_state(0).value()
        return _reference(self._constants, self._plan, way)[: size(ToolPose)]
