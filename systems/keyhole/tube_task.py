"""Tube task: brings the tube to its station before the entry, and keeps it there.

The station lies `standoff` before the entry E, on the axis z_E through the fulcrum at
rest, and moves with the organ. The way there is straight and smooth in time; the tool
of a planner that knows other tools can take its place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import along, norm, scaled, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Vector, finiteness, vector
from systems.common.signals import ToolMotion
from systems.common.step_block import StepBlock
from systems.keyhole.phases import Phases
from systems.keyhole.signals import Phase, SnakeStatus, TubeStatus
from systems.sensing.organ_estimator import OrganMotion

finite_organ, finite_phase = finiteness(OrganMotion), finiteness(Phase)
finite_snake, finite_tool = finiteness(SnakeStatus), finiteness(ToolMotion)
_STILL = (0.0, 0.0, 0.0)
_PROBE, _APPROACH = float(Phases.PROBE), float(Phases.APPROACH)


@dataclass
class TubeTaskParams:
    """Parameters of `TubeTask`."""

    standoff: float = parameter(
        0.053, "of the station from the entry", "m", least=0.0, most=0.15
    )
    speed: float = parameter(
        0.03, "mean, on the way to the station", "m/s", above=0.0, most=0.2
    )
    handing: float = parameter(
        1.5, "least time of that way, and from a planner's", "s", above=0.0, most=20.0
    )
    follow: bool = parameter(
        True, "whether the arm follows the organ; else it keeps to the mean place"
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0.0, most=0.1)


class Way(NamedTuple):
    """How far the tube is on its way: a share, its start, and what was commanded."""

    share: float
    first: Vector
    p: Vector
    v: Vector
    u: Vector


@compiled
def _task(
    c: Any,
    way: Way,
    time: float,
    phase: Phase,
    organ: OrganMotion,
    snake: SnakeStatus,
    planned: ToolMotion,
) -> tuple[Way, ToolMotion, TubeStatus]:
    told = finite_phase(phase) and finite_organ(organ) and finite_snake(snake)
    if not (told and finite_tool(planned)):  # stands still
        held = Way(way.share, way.first, way.p, _STILL, way.u)
        return (
            held,
            ToolMotion(way.p, way.u, _STILL, _STILL, time),
            TubeStatus(1.0, 0.0),
        )
    z = (c.axis[0], c.axis[1], c.axis[2])
    p_WE, v_WE = organ.p, organ.v
    if c.follow == 0.0:
        p_WE, v_WE = (c.entry[0], c.entry[1], c.entry[2]), _STILL
    station = along(p_WE, snake.advance - c.standoff, z)
    speed = along(v_WE, snake.rate, z)
    share, first = way.share, way.first
    by_plan = planned.time >= 0.0 and phase.code == _APPROACH
    if by_plan:
        first = along(planned.tip, time - planned.time, planned.v)
    rate = 0.0
    if phase.code != _PROBE and not by_plan and share < 1.0:
        length = norm(sub(station, first))
        rate = phase.pace * min(c.speed / max(length, 1e-6), 1.0 / c.handing)
        share = min(1.0, share + rate * c.period)
    g = share**3 * (10.0 + share * (6.0 * share - 15.0))
    slope = 30.0 * share**2 * (1.0 - share) ** 2 * rate
    p = along(first, g, sub(station, first))
    v = along(scaled(slope, sub(station, first)), g, speed)
    if by_plan:
        v = planned.v
    away = norm(sub(p, station))
    relative = norm(sub(v, speed))
    return (
        Way(share, first, p, v, way.u),
        ToolMotion(p, way.u, v, _STILL, time),
        TubeStatus(away, relative),
    )


class TubeTask(StepBlock):
    """Where the end of the tube is to be.

    Port ``phase`` accepts the operation's `Phase`.

    Port ``organ`` accepts the entry's `OrganMotion`.

    Port ``snake`` accepts the `SnakeStatus`: with it the tube advances to its work.

    Port ``planned`` accepts a planner's `ToolMotion`, that leads through the approach;
    without a wire the way is straight.

    Port ``tool`` emits the `ToolMotion` that the passive wrist takes; its u is none.

    Port ``status`` emits the `TubeStatus`.
    """

    def __init__(
        self,
        params: TubeTaskParams | None = None,
        p_WP: Sequence[float] = (0.0, 0.0, -0.06),
        p_WE: Sequence[float] = (0.0, 0.0, -0.12),
        axis: Sequence[float] = (0.0, 0.0, -1.0),
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            p_WP: Tube's end at the start in m.
            p_WE: The entry's place at rest in m.
            axis: z_E.
        """
        super().__init__()
        params = check(params or TubeTaskParams())
        p, u = vector(p_WP), vector(axis)
        self.declare_step(
            _task,
            [packed(params, first=p, entry=vector(p_WE), axis=u)],
            {
                "phase": Phase,
                "organ": OrganMotion,
                "snake": SnakeStatus,
                "planned": ToolMotion,
            },
            Way(0.0, p, p, _STILL, u),
            {"tool": ToolMotion, "status": TubeStatus},
            params.period,
            defaults={"planned": ToolMotion(p, u, _STILL, _STILL, -1.0)},
        )
