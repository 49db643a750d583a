"""Surgeon trajectory estimator: where a tool is, where it goes, how sure that is.

Section 2.2 of the paper (Figure 2): from the tool's tracked position the estimator
finds "its trajectory thanks to the velocity and acceleration parameters", for the
local planner. The paper gives no equations; here a Kalman filter over Singer's model.
"""

from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import along, dot, norm, scaled, sub, unit
from systems.common.parameter import Rules, check, parameter, part
from systems.common.signal import Vector, finiteness
from systems.common.signals import (
    ALIGNED,
    Alignment,
    Estimate,
    Point,
    TrackedShaft,
)
from systems.common.step_block import StepBlock
from systems.sensing.optical_tracker import NEVER, MarkerBody
from systems.sensing.shaft_fulcrum import (
    FIRST,
    FulcrumState,
    PointCovariance,
    absorb_line,
    initial_fulcrum,
    shaft_constants,
)
from systems.sensing.singer import (
    Covariance,
    correct_covariance,
    gains,
    predict_covariance,
)


@dataclass
class TrajectoryEstimatorParams:
    """What the estimator takes for granted of a tool, and when it gives up."""

    period: float = parameter(
        1 / 60, "of the update: the tracker's", "s", above=0, most=1
    )
    body: MarkerBody = part(MarkerBody)  # as the tracker has it
    # Of the hand, along each axis.
    sigma_acceleration: float = parameter(
        0.10, "standard deviation of the acceleration", "m/s^2", above=0, most=10
    )
    acceleration_time: float = parameter(
        0.25, "its time constant", "s", above=0, most=10
    )
    sigma_velocity: float = parameter(
        0.03, "standard deviation of the speed when first seen", "m/s", above=0, most=1
    )
    tremor_rms: float = parameter(
        100e-6, "tremor, which is no part of the trajectory", "m", least=0, most=0.002
    )
    gate: float = parameter(
        5.0, "standard deviations beyond which a tip is refused", least=1, most=20
    )
    # The prediction goes no further than the age limit: beyond it the tool is held
    # where it was predicted last.
    sigma_limit: float = parameter(
        0.003, "standard deviation of a known tip at the most", "m", above=0, most=0.02
    )
    age_limit: float = parameter(
        0.5, "age of a known tool's last good frame at the most", "s", above=0, most=2
    )
    fulcrum: list[float] | None = parameter(
        None, "p_WG if it is given, else estimated", "m", least=-1, most=1, shape=(3,)
    )
    # What is known of a fulcrum beforehand.
    wall_height: float = parameter(
        0.0, "of the abdominal wall, z in W", "m", least=-1, most=1
    )
    sigma_wall: float = parameter(
        0.01, "deviation of wall_height", "m", above=0, most=1
    )
    depth: float = parameter(0.12, "of a tip below its fulcrum", "m", least=0, most=0.5)
    sigma_depth: float = parameter(0.06, "deviation of depth", "m", above=0, most=1)
    fulcrum_drift: float = parameter(
        0.1e-3,
        "random walk of a fulcrum along each axis",
        "m/sqrt(s)",
        least=0,
        most=0.1,
    )
    # Lines that hardly turn do not say where along them a fulcrum that walks is.
    wall_pull: float = parameter(
        0.0,
        "in which its height is drawn to the wall's; 0: it is not",
        "s",
        least=0,
        most=1e3,
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        lived = self.age_limit >= self.period
        yield lived, "age_limit", f"at least the period, {self.period} s"


class State(NamedTuple):
    """The filters' state.

    Attributes:
        p: p_WP in m; with `v` in m/s and `a` in m/s^2 the trajectory.
        v: Likewise.
        a: Likewise.
        P: Their covariance, see `singer`.
        g: With `G` and `reference` the fulcrum's filter, see `FulcrumState`.
        G: Likewise.
        reference: Likewise.
        time: Of the last good frame, in s.
        shared: Variance of the tip that comes from the fulcrum's own error, in m^2.
    """

    p: Vector
    v: Vector
    a: Vector
    P: Covariance
    g: Vector
    G: PointCovariance
    reference: Vector
    time: float
    shared: float


finite_point = finiteness(Point)
LATEST = 1e-6
"""A frame's time may be this far ahead, in s: a clock's rounding."""


def constants(params: TrajectoryEstimatorParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(
        params,
        alpha=1.0 / params.acceleration_time,
        var_tremor=params.tremor_rms**2 / 3.0,
        **shaft_constants(params.body, params.fulcrum),
    )


def initial(params: TrajectoryEstimatorParams) -> State:
    """The state before the first frame."""
    rest = (0.0, 0.0, 0.0)
    fulcrum = initial_fulcrum(params.fulcrum)
    return State(rest, rest, rest, (0.0,) * 6, *fulcrum, NEVER, 0.0)


@compiled
def _predict_covariance(params: Any, x: State, dt: float) -> Covariance:
    return predict_covariance(x.P, dt, params.alpha, params.sigma_acceleration)


@compiled
def _predict_mean(params: Any, x: State, dt: float) -> tuple[Vector, Vector, Vector]:
    kp, kv, ka = gains(dt, params.alpha)
    p = along(along(x.p, dt, x.v), kp, x.a)
    return p, along(x.v, kv, x.a), scaled(ka, x.a)


@compiled
def absorb(params: Any, x: State, m: TrackedShaft) -> State:
    """The state after a measurement; the same state if there is nothing new.

    Args:
        params: A record of `constants`.
        x: The state before it.
        m: Refused if it is old, invalid, not finite, or too far from where the tip
            can be.
    """
    if not m.valid >= 0.5 or not x.time < m.time < math.inf:
        return x
    if not 0.9 < norm(m.u) < 1.1 or not finite_point(Point(m.tip)):
        return x
    u = unit(m.u)
    dt = FIRST if x.time == NEVER else m.time - x.time
    if dt < 0.0 or dt > params.age_limit:
        var_v = params.sigma_velocity * params.sigma_velocity
        var_a = params.sigma_acceleration * params.sigma_acceleration
        P = (1.0, 0.0, 0.0, var_v, 0.0, var_a)
        rest = (0.0, 0.0, 0.0)
        p, v, a = m.tip, rest, rest
    else:
        P = _predict_covariance(params, x, dt)
        p, v, a = _predict_mean(params, x, dt)
        miss = sub(m.tip, p)
        variance = P[0] + params.var_tip + params.var_tremor + x.shared
        if dot(miss, miss) > params.gate * params.gate * variance:
            return x
    c = along(m.tip, -params.lever, u)
    before = FulcrumState(x.g, x.G, x.reference)
    fulcrum, seen = absorb_line(params, before, c, u, dt)
    P, (kp, kv, ka) = correct_covariance(P, seen.variance + params.var_tremor)
    miss = sub(seen.tip, p)
    p, v, a = along(p, kp, miss), along(v, kv, miss), along(a, ka, miss)
    g, G, reference = fulcrum
    return State(p, v, a, P, g, G, reference, m.time, seen.shared)


@compiled
def predict(params: Any, x: State, t: float, shared: float = 0.0) -> Estimate:
    """The estimate at time `t` in s, see the port of `TrajectoryEstimator`.

    Args:
        params: A record of `constants`.
        x: The state.
        t: Time in s.
        shared: Standard deviation of an error that all tools' frames share, m.
    """
    age = max(t - x.time, 0.0)
    p, v, a = _predict_mean(params, x, min(age, params.age_limit))
    if age > params.age_limit:
        v = a = (0.0, 0.0, 0.0)
    sigma_p, sigma_v, sigma_a = 1.0, 1.0, 1.0
    if x.time != NEVER:
        pp, _, _, vv, _, aa = _predict_covariance(params, x, age)
        pp += x.shared + params.var_tremor + shared * shared
        sigma_p, sigma_v, sigma_a = math.sqrt(pp), math.sqrt(vv), math.sqrt(aa)
    from_future = x.time > t + LATEST  # whatever it says is not of this tool's past
    known = (
        not from_future and age <= params.age_limit and sigma_p <= params.sigma_limit
    )
    yes = 1.0 if known else 0.0
    return Estimate(p, v, a, x.g, sigma_p, sigma_v, sigma_a, yes, age)


@compiled
def _step(
    params: Any,
    state: State,
    time: float,
    measurement: TrackedShaft,
    alignment: Alignment,
) -> tuple[State, Estimate]:
    after = state
    if measurement.time <= time + LATEST:
        after = absorb(params, state, measurement)
    return after, predict(params, after, time, alignment.sigma)


class TrajectoryEstimator(StepBlock):
    """Estimates one tool's trajectory and fulcrum from its tracked shaft (section 2.2).

    A frame that is delivered at an instant is in the estimate of the same instant: the
    output is a map of state, measurement and time, and the update stores what it
    learned. Latency is made up for by predicting from the frame's time to now. While
    the tool is out of sight the prediction goes on and the standard deviations grow;
    a frame that is stamped in the future is refused;
    a frame that is late by more than the age limit starts the trajectory anew.

    Port ``measurement`` accepts a `TrackedShaft`.
    Port ``alignment`` accepts the tracker's `Alignment`, whose sigma is no noise, but
    wrong all the same; exact without a wire.
    Port ``estimate`` emits the `Estimate`, predicted to the time of the evaluation;
    sigma_p is of the true tip, tremor included, sigma_v and sigma_a are of the
    trajectory, tremor excluded.
    """

    def __init__(self, params: TrajectoryEstimatorParams | None = None) -> None:
        """Makes the block.

        Args:
            params: Markers, model of the hand, limits, fulcrum.

        Raises:
            ParameterError: If `params` make no sense.
        """
        super().__init__()
        params = params or TrajectoryEstimatorParams()
        self.declare_step(
            _step,
            [constants(params)],
            {"measurement": TrackedShaft, "alignment": Alignment},
            initial(params),
            {"estimate": Estimate},
            params.period,
            defaults={"alignment": ALIGNED},
        )
