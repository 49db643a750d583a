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
finite_snake = finiteness(SnakeStatus)
_STILL = (0.0, 0.0, 0.0)
_PROBE = float(Phases.PROBE)


@dataclass
class TubeTaskParams:
    """Parameters of `TubeTask`."""

    standoff: float = parameter(
        0.053, "of the station from the entry", "m", least=0.0, most=0.15
    )
    speed: float = parameter(
        0.03, "mean, on the way to the station", "m/s", above=0.0, most=0.2
    )
    follow: bool = parameter(
        True, "whether the arm follows the organ; else it keeps to the mean place"
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0.0, most=0.1)


class Way(NamedTuple):
    """How far the tube is on its way: a share, its start, and what was commanded."""

    share: float
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
) -> tuple[Way, ToolMotion, TubeStatus]:
    told = finite_phase(phase) and finite_organ(organ) and finite_snake(snake)
    if not told:  # stands still
        held = Way(way.share, way.p, _STILL, way.u)
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
    share = way.share
    first = (c.first[0], c.first[1], c.first[2])
    length = max(norm(sub(station, first)), 1e-6)
    rate = 0.0
    if phase.code != _PROBE and share < 1.0:
        rate = phase.pace * c.speed / length
        share = min(1.0, share + rate * c.period)
    g = share**3 * (10.0 + share * (6.0 * share - 15.0))
    slope = 30.0 * share**2 * (1.0 - share) ** 2 * rate
    p = along(first, g, sub(station, first))
    v = along(scaled(slope, sub(station, first)), g, speed)
    away = norm(sub(p, station))
    relative = norm(sub(v, speed))
    du = _STILL
    return (
        Way(share, p, v, way.u),
        ToolMotion(p, way.u, v, du, time),
        TubeStatus(away, relative),
    )


class TubeTask(StepBlock):
    """Where the end of the tube is to be.

    Port ``phase`` accepts the operation's `Phase`.

    Port ``organ`` accepts the entry's `OrganMotion`.

    Port ``snake`` accepts the `SnakeStatus`: with it the tube advances to its work.

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
            },
            Way(0.0, p, _STILL, u),
            {"tool": ToolMotion, "status": TubeStatus},
            params.period,
        )
