"""The "Velocity Corrections" behaviour: Bauzano et al., section 4.2, Table II.

The potential field sees the obstacle tool O where it is now. This behaviour
looks ahead: where O's predicted motion crosses the guide point's way, it slows
the robot so that the surgeon passes first: v_2 = -(1 - scale) v_1.

Crossing: within the horizon O's shaft sweeps the triangle of its fulcrum, its
tip now and its predicted tip. The guide point's way goes from M_R along v_1, as
far as the goal is. From where the way comes near the triangle, Table II gets the
distance from M_R and the time at which O's shaft is there. Short passages and
near misses count in part, so that v_2 has no steps.

An obstacle that stands has no crossing time: v_2 = 0, it is the potential
field's task (the paper's static case).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from systems.auto_guidance.nearest import obstacle_at
from systems.common.compiled import compiled, packed
from systems.common.fuzzy import RuleTable, activations, degrees, weighted_mean
from systems.common.geometry import (
    all_finite,
    along,
    cross,
    dot,
    norm,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Many, Vector
from systems.common.signals import Estimate, Guide, Velocity, finite_guide, usable
from systems.common.step_block import StepBlock

DISTANCES = ["Z", "AZ", "M", "F", "VF"]
TIMES = ["Z", "AZ", "M", "L", "VL"]
SPEEDS = ["S", "AS", "SM", "NM", "FM", "MM"]

TABLE_II = [
    ["S", "SM", "NM", "MM", "MM"],
    ["S", "SM", "NM", "MM", "MM"],
    ["SM", "SM", "NM", "FM", "MM"],
    ["AS", "AS", "SM", "NM", "MM"],
    ["AS", "AS", "AS", "SM", "FM"],
]
"""Rows: time until O crosses (TIMES); columns: distance to there (DISTANCES)."""


@dataclass
class VelocityCorrectionsParams:
    """Parameters of `VelocityCorrections`. The paper gives the labels only."""

    distances: list[float] = parameter(
        [0.0, 0.01, 0.025, 0.05, 0.08],
        f"centers of the distances {', '.join(DISTANCES)}",
        "m",
        least=0.0,
        most=0.5,
        shape=(5,),
    )
    times: list[float] = parameter(
        [0.0, 0.25, 0.5, 1.0, 2.0],
        f"centers of the times {', '.join(TIMES)}",
        "s",
        least=0.0,
        most=10.0,
        shape=(5,),
    )
    scales: list[float] = parameter(
        [0.0, 0.1, 0.25, 0.5, 0.75, 1.0],
        f"share of v_1 that is kept for the speeds {', '.join(SPEEDS)}",
        least=0.0,
        most=1.0,
        shape=(6,),
    )
    horizon: float = parameter(
        3.0,
        "how far ahead O is predicted; a crossing in the last quarter counts in part",
        "s",
        above=0.0,
        most=10.0,
    )
    acceleration_time: float = parameter(
        0.2,
        "time constant with which O's acceleration is taken to die out",
        "s",
        above=0.0,
        most=5.0,
    )
    moving_speed: float = parameter(
        0.01,
        "speed of O's tip from which on they count in full; not at all below half",
        "m/s",
        above=0.0,
        most=0.1,
    )
    near_distance: float = parameter(
        0.01,
        "how near the way must come to the swept triangle; a passage shorter than this "
        "counts in part",
        "m",
        above=0.0,
        most=0.1,
    )

    def rules(self) -> Rules:
        """What must hold across the parameters."""
        for name in ("distances", "times", "scales"):
            values = getattr(self, name)
            yield all(a < b for a, b in pairwise(values)), name, "increasing numbers"
        ends = (self.scales[0], self.scales[-1])
        yield ends == (0.0, 1.0), "scales", "0 at the start and 1 at the end"
        # So that VL acts in full at its center.
        enough = self.horizon >= 1.5 * self.times[-1]
        yield enough, "horizon", f">= 1.5 times the last of times={self.times}"


@compiled
def predicted_tip(obstacle: Estimate, ahead: float, acceleration_time: float) -> Vector:
    """O's tip `ahead` seconds from now, m.

    The acceleration is taken to die out (Singer's model): held constant over
    seconds, the noise of its estimate would throw the tip across the abdomen.
    """
    tau = acceleration_time
    share = tau * tau * (ahead / tau - 1.0 + exp(-ahead / tau))
    return along(along(obstacle.p, ahead, obstacle.v), share, obstacle.a)


class Crossing(NamedTuple):
    """Where and when O's shaft crosses the guide point's way.

    Attributes:
        distance: From M_R, m.
        time: From now, s.
        degree: To which there is a crossing, in [0, 1].
    """

    distance: float
    time: float
    degree: float


@compiled
def crossing(guide: Guide, v1: Vector, obstacle: Estimate, params: Any) -> Crossing:
    """Where and when O's shaft crosses the guide point's way, if it does.

    Args:
        guide: The guide point.
        v1: Velocity of the guide point, m/s.
        obstacle: Of O.
        params: A record of `constants`.
    """
    none = Crossing(0.0, 0.0, 0.0)
    speed = norm(v1)
    moving = 2.0 * norm(obstacle.v) / params.moving_speed - 1.0
    if speed < 1e-9 or moving <= 0.0:
        return none
    g = obstacle.fulcrum
    a = sub(obstacle.p, g)
    b = sub(predicted_tip(obstacle, params.horizon, params.acceleration_time), g)
    n = cross(a, b)
    n2 = dot(n, n)
    if n2 < 1e-16:  # O slides along itself
        return none
    # At the distance d on the way, over the plane of the sweep by h:
    # foot = alpha a + beta b, h = h0 + h1 d, alpha and beta likewise.
    m = sub(guide.M_R, g)
    e = unit(v1)
    size = sqrt(n2)
    h0, h1 = dot(m, n) / size, dot(e, n) / size
    b_n, n_a = cross(b, n), cross(n, a)
    alpha0, alpha1 = dot(m, b_n) / n2, dot(e, b_n) / n2
    beta0, beta1 = dot(m, n_a) / n2, dot(e, n_a) / n2
    near = params.near_distance
    low, high = 0.0, norm(sub(guide.M_Rf, guide.M_R)) + near
    for c0, c1 in (
        (near - h0, -h1),
        (near + h0, h1),
        (alpha0, alpha1),
        (beta0, beta1),
        (1.0 - alpha0 - beta0, -alpha1 - beta1),
    ):
        # Keep the part of the way with c0 + c1 d >= 0.
        if c1 > 1e-12:
            low = max(low, -c0 / c1)
        elif c1 < -1e-12:
            high = min(high, -c0 / c1)
        elif c0 < 0.0:
            return none
    if low >= high:
        return none
    beta = max(0.0, beta0 + beta1 * low)
    reach = alpha0 + alpha1 * low + beta
    time = params.horizon * beta / max(reach, 1e-9)
    h_low, h_high = h0 + h1 * low, h0 + h1 * high
    height = 0.0 if h_low * h_high < 0.0 else min(abs(h_low), abs(h_high))
    degree = min(
        1.0,
        moving,
        (high - low) / near,
        2.0 * (1.0 - height / near),
        4.0 * (1.0 - time / params.horizon),
    )
    return Crossing(low, time, degree) if degree > 0.0 else none


def constants(params: VelocityCorrectionsParams) -> np.ndarray:
    """The parameters and Table II as the compiled functions take them."""
    check(params)
    scales = {s: [x] for s, x in zip(SPEEDS, params.scales, strict=True)}
    return packed(params, table=RuleTable(TABLE_II, scales).cells)


@compiled
def speed_scale(params: Any, distance: float, time: float) -> float:
    """Table II: the share of v_1 kept, in [0, 1].

    Args:
        params: A record of `constants`.
        distance: From M_R to the crossing, m.
        time: Until O is there, s.
    """
    rows, columns = degrees(params.times, time), degrees(params.distances, distance)
    weight = activations(params.table, len(params.scales), rows, columns)
    return weighted_mean(weight, params.scales.reshape((-1, 1)))[0]


@compiled
def velocity_correction(
    params: Any, v1: Vector, guide: Guide, obstacle: Estimate
) -> Vector:
    """v_2, m/s; zero where O is not known.

    Args:
        params: A record of `constants`.
        v1: Velocity of the guide point, m/s.
        guide: The guide point.
        obstacle: Of O.
    """
    if not (usable(obstacle) and all_finite(v1) and finite_guide(guide)):
        return 0.0, 0.0, 0.0
    there = crossing(guide, v1, obstacle, params)
    if there.degree <= 0.0:
        return 0.0, 0.0, 0.0
    kept = speed_scale(params, there.distance, there.time)
    return scaled(-there.degree * (1.0 - kept), v1)


@compiled
def _correct(
    params: Any, v1: Velocity, guide: Guide, obstacles: np.ndarray
) -> tuple[Velocity]:
    obstacle = obstacle_at(guide, obstacles)
    return (Velocity(velocity_correction(params, v1.v, guide, obstacle)),)


class VelocityCorrections(StepBlock):
    """Slows the robot's tool where the obstacle tool is about to cross its way.

    Bauzano et al., section 4.2, Table II; see the module. A pure map of its
    inputs.

    Port ``v1`` accepts the guide point's `Velocity` v_1.
    Port ``guide`` accepts the `Guide`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool; O is the nearest.
    Port ``v2`` emits the correction v_2, a `Velocity`.
    """

    def __init__(
        self,
        params: VelocityCorrectionsParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            obstacles: Names of the obstacle tools.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.declare_map(
            _correct,
            [constants(params or VelocityCorrectionsParams())],
            {
                "v1": Velocity,
                "guide": Guide,
                "obstacles": Many(Estimate, tuple(obstacles)),
            },
            "v2",
            Velocity,
        )
