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

from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, sqrt
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.fuzzy import RuleTable, activations, degrees, weighted_mean
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    cross,
    dot,
    norm,
    sub,
    unit,
    xyz,
)
from systems.common.signals import (
    GUIDE_EXAMPLE,
    OBSTACLE_EXAMPLE,
    acceleration,
    fulcrum,
    usable,
    velocity,
)

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
    """Parameters of `VelocityCorrections`. The paper gives the labels only.

    Attributes:
        distances: Centers of the DISTANCES Z, AZ, M, F, VF, m.
        times: Centers of the TIMES Z, AZ, M, L, VL, s.
        scales: Share of v_1 that is kept for the SPEEDS S, AS, SM, NM, FM, MM.
        horizon: How far ahead O is predicted, s; a crossing in the last quarter
            counts in part.
        acceleration_time: Time constant with which O's acceleration is taken to
            die out, s.
        moving_speed: Speed of O's tip from which on corrections count in full,
            m/s; not at all below half of it.
        near_distance: How near the way must come to the swept triangle, m; a
            passage shorter than this counts in part.
    """

    distances: list[float] = field(
        default_factory=lambda: [0.0, 0.01, 0.025, 0.05, 0.08]
    )
    times: list[float] = field(default_factory=lambda: [0.0, 0.25, 0.5, 1.0, 2.0])
    scales: list[float] = field(
        default_factory=lambda: [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
    )
    horizon: float = 2.0
    acceleration_time: float = 0.2
    moving_speed: float = 0.01
    near_distance: float = 0.01

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        for name, labels in (
            ("distances", DISTANCES),
            ("times", TIMES),
            ("scales", SPEEDS),
        ):
            values = getattr(self, name)
            if len(values) != len(labels) or not values[0] >= 0.0:
                raise ValueError(
                    f"{name}={values} must be {len(labels)} values >= 0, for "
                    f"{', '.join(labels)}"
                )
            if not all(a < b for a, b in pairwise(values)):
                raise ValueError(f"{name}={values} must increase")
        if self.scales[0] != 0.0 or self.scales[-1] != 1.0:
            raise ValueError(f"scales={self.scales} must start at 0 and end at 1")
        for name in ("horizon", "acceleration_time", "moving_speed", "near_distance"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name}={value} must be finite and > 0")


@compiled
def predicted_tip(obstacle: Numbers, ahead: float, acceleration_time: float) -> Vector:
    """O's tip `ahead` seconds from now, m.

    The acceleration is taken to die out (Singer's model): held constant over
    seconds, the noise of its estimate would throw the tip across the abdomen.
    """
    tau = acceleration_time
    share = tau * tau * (ahead / tau - 1.0 + exp(-ahead / tau))
    return along(
        along(xyz(obstacle, 0), ahead, velocity(obstacle)),
        share,
        acceleration(obstacle),
    )


@compiled
def crossing(
    guide: Numbers,
    v1: Numbers,
    obstacle: Numbers,
    params: Any,
) -> tuple[float, float, float]:
    """Where and when O's shaft crosses the guide point's way.

    Args:
        guide: The guide signal (12).
        v1: Velocity of the guide point, m/s.
        obstacle: Estimate (17) of O.
        params: A record of `constants`.

    Returns:
        (distance from M_R in m, time from now in s, degree in [0, 1] to which
        there is a crossing); degree 0 if there is none.
    """
    none = (0.0, 0.0, 0.0)
    speed = norm(v1)
    moving = 2.0 * norm(velocity(obstacle)) / params.moving_speed - 1.0
    if speed < 1e-9 or moving <= 0.0:
        return none
    g = fulcrum(obstacle)
    a = sub(xyz(obstacle, 0), g)
    b = sub(predicted_tip(obstacle, params.horizon, params.acceleration_time), g)
    n = cross(a, b)
    n2 = dot(n, n)
    if n2 < 1e-16:  # O slides along itself
        return none
    # At the distance d on the way, over the plane of the sweep by h:
    # foot = alpha a + beta b, h = h0 + h1 d, alpha and beta likewise.
    m = sub(xyz(guide, 0), g)
    e = unit(v1)
    size = sqrt(n2)
    h0, h1 = dot(m, n) / size, dot(e, n) / size
    b_n, n_a = cross(b, n), cross(n, a)
    alpha0, alpha1 = dot(m, b_n) / n2, dot(e, b_n) / n2
    beta0, beta1 = dot(m, n_a) / n2, dot(e, n_a) / n2
    near = params.near_distance
    low, high = 0.0, norm(sub(xyz(guide, 9), xyz(guide, 0))) + near
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
    return (low, time, degree) if degree > 0.0 else none


def constants(params: VelocityCorrectionsParams) -> np.ndarray:
    """The parameters and Table II as the compiled functions take them."""
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
    params: Any, v1: Numbers, guide: Numbers, obstacle: Numbers
) -> Vector:
    """v_2, m/s; zero where O is not known.

    Args:
        params: A record of `constants`.
        v1: Velocity of the guide point, m/s.
        guide: The guide signal (12).
        obstacle: Estimate (17) of O.
    """
    if not (usable(obstacle) and all_finite(v1) and all_finite(guide)):
        return 0.0, 0.0, 0.0
    distance, time, degree = crossing(guide, v1, obstacle, params)
    if degree <= 0.0:
        return 0.0, 0.0, 0.0
    cut = -degree * (1.0 - speed_scale(params, distance, time))
    return cut * v1[0], cut * v1[1], cut * v1[2]


@compiled
def _v2(
    record: np.ndarray, v1: np.ndarray, guide: np.ndarray, obstacle: np.ndarray
) -> np.ndarray:
    return np.array(velocity_correction(record[0], xyz(v1, 0), guide, obstacle))


class VelocityCorrections(Block):
    """Slows the robot's tool where the obstacle tool is about to cross its way.

    Bauzano et al., section 4.2, Table II; see the module. A pure map of its
    inputs.

    Port ``v1`` accepts the guide point's velocity v_1 (3), m/s, in W.
    Port ``guide`` accepts the guide signal (12).
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``v2`` emits the correction v_2 (3), m/s, in W.
    """

    def __init__(self, params: VelocityCorrectionsParams | None = None) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self._params = params or VelocityCorrectionsParams()
        self._params.check()
        self._constants = constants(self._params)
        self._v1 = self.vector_in("v1", [0.05, 0.0, 0.0])
        self._guide = self.vector_in("guide", GUIDE_EXAMPLE)
        self._obstacle = self.vector_in("obstacle", OBSTACLE_EXAMPLE)
        self.vector_out(
            "v2",
            3,
            self._calc_v2,
            {
                self._v1.ticket(),
                self._guide.ticket(),
                self._obstacle.ticket(),
            },
        )

    def _calc_v2(self, context: Any) -> np.ndarray:
        return _v2(
            self._constants,
            self._v1.Eval(context),
            self._guide.Eval(context),
            self._obstacle.Eval(context),
        )
