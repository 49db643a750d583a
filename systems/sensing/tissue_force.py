"""Tissue force: what an organ does to R's tip, told apart from the wall by its moment.

The wrist's sensor feels wall and tissue together. Whatever the wall does acts in the
fulcrum I: the spring across the shaft, the seal's friction along it. Neither has a
moment about I; the tissue's force F n at the tip P has:

    m_I = m_S - (p_I - p_S) x f = F (p_P - p_I) x n,

n being the organ's normal there. F is the least-squares solution; its zero is taken
while the tip is still clear. It is noisy, so what is fast comes from how deep the tip
goes,

    dF^/dt = k d(depth)/dt + (F - F^) / tau,

with a stiffness k that need be known roughly only. Straight along the shaft (n parallel
to P - I) the touch has no moment, and cannot be told from friction: then F is not
known.
"""

from dataclasses import dataclass
from math import exp
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.distance import Organs, distance, normal
from plants.organs.organs import OrganSet, arrays, port
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, cross, dot, norm, scaled, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector
from systems.common.signals import Point, ShaftMotion, Wrench
from systems.common.step_block import StepBlock


class TissueTouch(NamedTuple):
    """What is known of the touch at R's tip."""

    force: Annotated[float, Field("N", "F, along n", 0.0)]
    n: Annotated[Vector, Field("1", "the organ's normal", (0.0, 0.0, 1.0))]
    p: Annotated[Vector, Field("m", "p_WP of the tip", (0.0, 0.0, -0.12))]
    room: Annotated[float, Field("m", "from the gauze to the organ", 0.01)]
    organ: Annotated[float, Field("1", "number of the nearest organ", 0.0)]
    known: Annotated[float, Field("1", "1 if F has a moment, else 0", 1.0)]
    zero: Annotated[float, Field("N", "that is taken away", 0.0)]


@dataclass
class TissueForceParams:
    """Parameters of `TissueForce`."""

    period: float = parameter(1 / 120, "of the readings", "s", above=0.0, most=0.1)
    stiffness: float = parameter(500.0, "k, as expected", "N/m", least=0.0, most=5000.0)
    time_constant: float = parameter(0.8, "tau", "s", least=0.0, most=5.0)
    zero_time: float = parameter(
        1.0, "time constant of the zero, while clear", "s", above=0.0, most=60.0
    )
    touch_room: float = parameter(
        0.002, "nearer to an organ the tip may touch it", "m", least=0.0, most=0.01
    )
    least_lever: float = parameter(
        0.03, "|(P - I) x n|, below it F is not known", "m", above=0.0, most=0.2
    )


@compiled
def tissue_force(
    m_S: Vector, f: Vector, p_S: Vector, p_I: Vector, p_P: Vector, n: Vector
) -> tuple[float, float]:
    """F in N, by the moment about the fulcrum, and its lever in m.

    Args:
        m_S: Moment about S, N m.
        f: Force, N.
        p_S: Where the sensor is, m.
        p_I: The fulcrum, m.
        p_P: R's tip, m.
        n: The organ's normal.
    """
    m_I = sub(m_S, cross(sub(p_I, p_S), f))
    arm = cross(sub(p_P, p_I), n)
    square = dot(arm, arm)
    return dot(m_I, arm) / max(square, 1e-9), norm(arm)


@compiled
def _update(
    params: Any,
    values: np.ndarray,
    table: np.ndarray,
    touch: TissueTouch,
    wrench: Wrench,
    shaft: ShaftMotion,
    pivot: Point,
    moved: np.ndarray,
) -> tuple[TissueTouch]:
    organs = Organs(values, table, moved)
    p = along(shaft.p, params.length, shaft.u)
    room, organ = 1e9, 0
    for k in range(len(organs.table)):
        here = distance(organs, k, p) - GAUZE_RADIUS
        if here < room:
            room, organ = here, k
    n = normal(organs, organ, p)
    raw, lever = tissue_force(wrench.m, wrench.f, shaft.p, pivot.p, p, n)
    known = wrench.valid > 0.5 and lever > params.least_lever and abs(raw) < 1e3
    force, zero = touch.force, touch.zero
    if not known:
        return (TissueTouch(0.0, n, p, room, float(organ), 0.0, zero),)
    if room > params.touch_room:
        share = 1.0 - exp(-params.period / params.zero_time)
        zero += share * (raw - zero)
        force = 0.0
    else:
        share = 1.0
        if params.time_constant > 0.0:
            share = 1.0 - exp(-params.period / params.time_constant)
        deeper = max(0.0, -room) - max(0.0, -touch.room)
        force += params.stiffness * deeper + share * (raw - zero - force)
    return (TissueTouch(force, n, p, room, float(organ), 1.0, zero),)


class TissueForce(StepBlock):
    """Tells the tissue's force at R's tip from the wall's; see the module.

    Port ``wrench`` accepts the `Wrench` of wall and tissue together.
    Port ``shaft`` accepts the `ShaftMotion`.
    Port ``pivot`` accepts the fulcrum as the wrist has it, a `Point`.
    Port ``organs`` accepts the `MovingPoint` of each organ.
    Port ``touch`` emits the `TissueTouch`, a sample late.
    """

    def __init__(
        self,
        params: TissueForceParams | None = None,
        organs: OrganSet | None = None,
        length: float = 0.4,
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters; the defaults if None.
            organs: The organs; without any, one that is far away.
            length: From the sensor to R's tip, m.
        """
        super().__init__()
        params = params or TissueForceParams()
        check(params)
        organs = organs or OrganSet.nothing()
        nowhere = (0.0, 0.0, 0.0)
        start = TissueTouch(0.0, (0.0, 0.0, 1.0), nowhere, 1.0, 0.0, 0.0, 0.0)
        self.declare_update(
            _update,
            [packed(params, length=float(length)), *arrays(organs)],
            {
                "wrench": Wrench,
                "shaft": ShaftMotion,
                "pivot": Point,
                **port(organs),
            },
            {"touch": start},
            params.period,
            timed=False,
        )


@compiled
def _without(wrench: Wrench, shaft: ShaftMotion, touch: TissueTouch) -> tuple[Wrench]:
    push = scaled(touch.force, touch.n)
    moment = cross(sub(touch.p, shaft.p), push)
    return (Wrench(sub(wrench.f, push), sub(wrench.m, moment), wrench.valid),)


class WallWrench(StepBlock):
    """Takes the tissue's force away from what the sensor feels: the wall is left.

    Port ``wrench`` accepts the `Wrench` of wall and tissue together.
    Port ``shaft`` accepts the `ShaftMotion`.
    Port ``touch`` accepts the `TissueTouch`.
    Port ``wall`` emits the `Wrench` of the wall.
    """

    def __init__(self) -> None:
        """Makes the block."""
        super().__init__()
        inputs = {"wrench": Wrench, "shaft": ShaftMotion, "touch": TissueTouch}
        self.declare_map(_without, [], inputs, "wall", Wrench)
