"""Surgeon trajectory estimator: where a tool is, where it goes, how sure that is.

Section 2.2 of the paper (Figure 2): from the tool's tracked position the estimator
finds "its trajectory thanks to the velocity and acceleration parameters", for the
local planner. The paper gives no equations; here a Kalman filter over Singer's model.
"""

from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    dot,
    norm,
    sub,
    unit,
    xyz,
)
from systems.sensing.optical_tracker import NEVER, MarkerBody
from systems.sensing.shaft_fulcrum import (
    FIRST,
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
    """What the estimator takes for granted of a tool, and when it gives up. SI."""

    # Time between updates in s; the tracker's.
    period: float = 1.0 / 60.0
    # The markers on the tool, as the tracker's.
    body: MarkerBody = field(default_factory=MarkerBody)
    # The hand's acceleration along each axis: standard deviation in m/s^2 and time
    # constant in s.
    sigma_acceleration: float = 0.10
    acceleration_time: float = 0.25
    # Speed along each axis that a tool may have when it is first seen, standard
    # deviation in m/s.
    sigma_velocity: float = 0.03
    # Tremor that is in the measured tip but is no part of the trajectory, root mean
    # square in three dimensions, in m.
    tremor_rms: float = 100e-6
    # A measured tip further from the predicted one than this many standard
    # deviations (in three dimensions) is refused.
    gate: float = 5.0
    # The tool is no longer known if the standard deviation of its tip along an axis
    # exceeds this, in m,
    sigma_limit: float = 0.003
    # or if the last good frame is older than this, in s. The prediction goes no
    # further either: beyond it the tool is held where it was predicted last.
    age_limit: float = 0.5
    # The tool's fulcrum in W in m, if it is given; otherwise it is estimated.
    fulcrum: list[float] | None = None
    # What is known of a fulcrum beforehand: the abdominal wall's height in W in m,
    # and its standard deviation; and how far above the tip it may be.
    wall_height: float = 0.0
    sigma_wall: float = 0.010
    depth: float = 0.12
    sigma_depth: float = 0.06
    # How fast a fulcrum may wander: random walk along each axis in m/sqrt(s).
    fulcrum_drift: float = 0.1e-3

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        self.body.check()
        for name in (
            "period",
            "sigma_acceleration",
            "acceleration_time",
            "sigma_velocity",
            "gate",
            "sigma_limit",
            "age_limit",
            "sigma_wall",
            "sigma_depth",
        ):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(
                    f"trajectory estimator: {name}={value} must be finite and > 0"
                )
        for name in ("tremor_rms", "depth", "fulcrum_drift"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(
                    f"trajectory estimator: {name}={value} must be finite and >= 0"
                )
        if self.age_limit < self.period:
            raise ValueError(
                f"trajectory estimator: age_limit={self.age_limit} s must be at least "
                f"the period, {self.period} s"
            )
        if not math.isfinite(self.wall_height):
            raise ValueError(
                f"trajectory estimator: wall_height={self.wall_height} must be finite"
            )
        if self.fulcrum is not None and (
            len(self.fulcrum) != 3 or not all(map(math.isfinite, self.fulcrum))
        ):
            raise ValueError(
                f"trajectory estimator: fulcrum={self.fulcrum} must be 3 finite "
                f"numbers, or null if it is to be estimated"
            )


def constants(params: TrajectoryEstimatorParams) -> np.ndarray:
    """The parameters as the compiled functions take them.

    Raises:
        ValueError: If `params` make no sense.
    """
    params.check()
    return packed(
        params,
        alpha=1.0 / params.acceleration_time,
        var_tremor=params.tremor_rms**2 / 3.0,
        **shaft_constants(params.body, params.fulcrum),
    )


def initial(params: TrajectoryEstimatorParams) -> np.ndarray:
    """The state (29) before the first frame.

    p, v, a (9), their covariance (6, see `singer`), the fulcrum's filter (12, see
    `shaft_fulcrum`), time of the last good frame in s (1), and the variance of the
    tip that comes from the fulcrum's own error (1).
    """
    return np.array([0.0] * 15 + initial_fulcrum(params.fulcrum) + [NEVER, 0.0])


@compiled
def _predict_covariance(params: Any, x: Numbers, dt: float) -> Covariance:
    now = (x[9], x[10], x[11], x[12], x[13], x[14])
    return predict_covariance(now, dt, params.alpha, params.sigma_acceleration)


@compiled
def _predict_mean(params: Any, x: Numbers, dt: float) -> tuple[Vector, Vector, Vector]:
    kp, kv, ka = gains(dt, params.alpha)
    p, v, a = xyz(x, 0), xyz(x, 3), xyz(x, 6)
    return (
        along(along(p, dt, v), kp, a),
        along(v, kv, a),
        (ka * a[0], ka * a[1], ka * a[2]),
    )


@compiled
def absorb(params: Any, x: np.ndarray, m: Numbers) -> np.ndarray:
    """The state after a measurement; the same state if there is nothing new.

    Args:
        params: A record of `constants`.
        x: State (29), see `initial`.
        m: p_WP, u_W, frame time, valid (8); refused if it is old, invalid, not
            finite, or too far from where the tip can be.
    """
    last, frame, valid = x[27], m[6], m[7]
    if not valid >= 0.5 or not last < frame < math.inf:
        return x
    measured = xyz(m, 0)
    length = norm(xyz(m, 3))
    if not 0.9 < length < 1.1 or not all_finite(measured):
        return x
    u = unit(xyz(m, 3))
    dt = FIRST if last == NEVER else frame - last
    if dt < 0.0 or dt > params.age_limit:
        var_v = params.sigma_velocity * params.sigma_velocity
        var_a = params.sigma_acceleration * params.sigma_acceleration
        P = (1.0, 0.0, 0.0, var_v, 0.0, var_a)
        rest = (0.0, 0.0, 0.0)
        p, v, a = measured, rest, rest
    else:
        P = _predict_covariance(params, x, dt)
        p, v, a = _predict_mean(params, x, dt)
        miss = sub(measured, p)
        variance = P[0] + params.var_tip + params.var_tremor + x[28]
        if dot(miss, miss) > params.gate * params.gate * variance:
            return x
    c = along(measured, -params.lever, u)
    fulcrum, tip, variance, shared = absorb_line(params, x[15:27], c, u, dt)
    P, (kp, kv, ka) = correct_covariance(P, variance + params.var_tremor)
    innovation = sub(tip, p)
    p = along(p, kp, innovation)
    v = along(v, kv, innovation)
    a = along(a, ka, innovation)
    return np.array(p + v + a + P + fulcrum + (frame, shared))


@compiled
def predict(params: Any, x: np.ndarray, t: float) -> np.ndarray:
    """The estimate (17) at time `t` in s, see the port of `TrajectoryEstimator`.

    Args:
        params: A record of `constants`.
        x: State (29), see `initial`.
        t: Time in s.
    """
    age = max(t - x[27], 0.0)
    p, v, a = _predict_mean(params, x, min(age, params.age_limit))
    if age > params.age_limit:
        v = a = (0.0, 0.0, 0.0)
    sigmas = (1.0, 1.0, 1.0)
    if x[27] != NEVER:
        pp, _, _, vv, _, aa = _predict_covariance(params, x, age)
        pp += x[28] + params.var_tremor
        sigmas = (math.sqrt(pp), math.sqrt(vv), math.sqrt(aa))
    known = age <= params.age_limit and sigmas[0] <= params.sigma_limit
    fulcrum = xyz(x, 15)
    return np.array(p + v + a + fulcrum + sigmas + (1.0 if known else 0.0, age))


@compiled
def _absorb(record: np.ndarray, x: np.ndarray, m: np.ndarray) -> np.ndarray:
    return absorb(record[0], x, m)


@compiled
def _estimate(record: np.ndarray, x: np.ndarray, m: np.ndarray, t: float) -> np.ndarray:
    return predict(record[0], absorb(record[0], x, m), t)


class TrajectoryEstimator(Block):
    """Estimates one tool's trajectory and fulcrum from its tracked shaft (section 2.2).

    A frame that is delivered at an instant is in the estimate of the same instant: the
    output is a map of state, measurement and time, and the update stores what it
    learned. Latency is made up for by predicting from the frame's time to now. While
    the tool is out of sight the prediction goes on and the standard deviations grow;
    a frame that is late by more than the age limit starts the trajectory anew.

    Port ``measurement`` accepts a tracked shaft (8): p_WP in m, unit vector u_W, time
    of exposure in s, valid (1 or 0), world frame W. Port ``estimate`` emits (17),
    predicted to the time of the evaluation: p_WP in m, v_WP in m/s, a_WP in m/s^2,
    the tool's fulcrum p_WG in m (3 each, in W), then along each axis the standard
    deviations sigma_p in m (of the true tip, tremor included), sigma_v in m/s and
    sigma_a in m/s^2 (of the trajectory, tremor excluded), known (1 if the estimate is
    usable, else 0), and the age of the last good frame in s.

    Args:
        params: Markers, model of the hand, limits, fulcrum.

    Raises:
        ValueError: If `params` make no sense.
    """

    def __init__(self, params: TrajectoryEstimatorParams | None = None) -> None:
        super().__init__()
        params = params or TrajectoryEstimatorParams()
        self._constants = constants(params)
        self._measurement = self.vector_in(
            "measurement", [0.05, 0.0, -0.12, 0.0, 0.0, -1.0, 0.0, 1.0]
        )
        self.DeclareDiscreteState(initial(params))
        self.vector_out(
            "estimate",
            17,
            self._calc_estimate,
            {self.xd_ticket(), self._measurement.ticket(), self.time_ticket()},
        )
        self.update_every(params.period, self._update)

    def _update(self, context: Any) -> np.ndarray:
        state = context.get_discrete_state(0).value()
        return _absorb(self._constants, state, self._measurement.Eval(context))

    def _calc_estimate(self, context: Any) -> np.ndarray:
        state = context.get_discrete_state(0).value()
        measurement = self._measurement.Eval(context)
        return _estimate(self._constants, state, measurement, context.get_time())
