"""Tissue force: what an organ does to R's tip, told apart from the wall by its moment.

The wrist's sensor feels wall and tissue together. Whatever the wall does acts in the
fulcrum I: the spring across the shaft, the seal's friction along it. Neither has a
moment about I; the tissue's force F n at the tip P has:

    m_I = m_S - (p_I - p_S) x f = F (p_P - p_I) x n,

n being the organ's normal there. A Kalman filter (`touch_filter`) knows the sensor's
noise and drift, and from them its zero, the tissue's stiffness k and where the surface
is, so that what is fast comes from how deep the tip goes. Straight along the shaft (n
parallel to P - I) the touch has no moment, and cannot be told from friction: then F is
not known.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.distance import Organs, distance, normal
from plants.organs.distance_grid import ERROR
from plants.organs.organs import OrganSet, arrays, port
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, cross, dot, norm, scaled, sub, xyz
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector
from systems.common.signals import Point, ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.sensing.touch_filter import SIZE, doubt, pressing, prior, weigh


class TissueTouch(NamedTuple):
    """What is known of the touch at R's tip."""

    force: Annotated[float, Field("N", "F, along n", 0.0)]
    n: Annotated[Vector, Field("1", "the organ's normal", (0.0, 0.0, 1.0))]
    p: Annotated[Vector, Field("m", "p_WP of the tip", (0.0, 0.0, -0.12))]
    room: Annotated[float, Field("m", "from the gauze to the organ", 0.01)]
    organ: Annotated[float, Field("1", "number of the nearest organ", 0.0)]
    known: Annotated[float, Field("1", "1 if F has a moment, else 0", 1.0)]
    zero: Annotated[float, Field("N", "that is taken away", 0.0)]
    sigma: Annotated[float, Field("N", "of F", 0.02)]


@dataclass
class TissueForceParams:
    """Parameters of `TissueForce`."""

    period: float = parameter(1 / 120, "of the readings", "s", above=0.0, most=0.1)
    stiffness: float = parameter(500.0, "k, as expected", "N/m", above=0.0, most=5000.0)
    stiffness_doubt: float = parameter(
        0.5, "standard deviation of k over that", above=0.0, most=1.0
    )
    surface_doubt: float = parameter(
        ERROR, "standard deviation of where the surface is", "m", above=0.0, most=0.01
    )
    # Of the sensor, as `ToolWrenchParams` and `FulcrumParams` have them.
    force_noise: float = parameter(
        0.05, "standard deviation of each axis", "N", above=0, most=5
    )
    moment_noise: float = parameter(
        0.005, "standard deviation of each axis", "N m", above=0, most=0.5
    )
    force_drift: float = parameter(
        0.004, "random walk of the bias", "N/sqrt(s)", least=0, most=1
    )
    moment_drift: float = parameter(
        0.0004, "random walk of the bias", "N m/sqrt(s)", least=0, most=0.1
    )
    force_bias: float = parameter(
        0.02, "standard deviation of the bias at first", "N", above=0, most=5
    )
    moment_bias: float = parameter(
        0.002, "standard deviation of the bias at first", "N m", above=0, most=0.5
    )
    touch_room: float = parameter(
        0.002, "nearer to an organ the tip may touch it", "m", least=0.0, most=0.01
    )
    least_lever: float = parameter(
        0.03, "|(P - I) x n|, below it F is not known", "m", above=0.0, most=0.2
    )


@compiled
def moment_about(p_I: Vector, m_S: Vector, f: Vector, p_S: Vector) -> Vector:
    """Moment about the fulcrum I in N m, of a force f in N and a moment about S."""
    return sub(m_S, cross(sub(p_I, p_S), f))


@compiled
def _update(
    params: Any,
    values: np.ndarray,
    table: np.ndarray,
    touch: TissueTouch,
    belief: np.ndarray,
    wrench: Wrench,
    shaft: ShaftMotion,
    pivot: Point,
    moved: np.ndarray,
) -> tuple[TissueTouch, np.ndarray]:
    organs = Organs(values, table, moved)
    p = along(shaft.p, params.length, shaft.u)
    room, organ = 1e9, 0
    for k in range(len(organs.table)):
        here = distance(organs, k, p) - GAUZE_RADIUS
        if here < room:
            room, organ = here, k
    n = normal(organs, organ, p)
    reach, arm = norm(sub(pivot.p, shaft.p)), cross(sub(p, pivot.p), n)
    m_I = moment_about(pivot.p, wrench.m, wrench.f, shaft.p)
    near = room <= params.touch_room
    lever = norm(arm)
    known = wrench.valid > 0.5 and lever > params.least_lever and norm(m_I) < 1e3
    x = belief.reshape((SIZE + 1, SIZE))
    # What has no lever says nothing of the zero either, but where nothing is touched.
    if wrench.valid > 0.5 and norm(m_I) < 1e3 and (known or not near):
        x = weigh(params, x, m_I, reach, scaled(1.0 if near else 0.0, arm), -room)
    force = pressing(x, -room) if known and near else 0.0
    zero = dot(xyz(x[0], 0), arm) / max(lever * lever, 1e-9)
    sigma, is_known = doubt(x, max(0.0, -room)), 1.0 if known else 0.0
    after = TissueTouch(force, n, p, room, float(organ), is_known, zero, sigma)
    return after, x.ravel()


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
        start = TissueTouch(0.0, (0.0, 0.0, 1.0), nowhere, 1.0, 0.0, 0.0, 0.0, 0.0)
        self.declare_update(
            _update,
            [packed(params, length=float(length)), *arrays(organs)],
            {
                "wrench": Wrench,
                "shaft": ShaftMotion,
                "pivot": Point,
                **port(organs),
            },
            {"touch": start, "_belief": prior(params, length).ravel()},
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
