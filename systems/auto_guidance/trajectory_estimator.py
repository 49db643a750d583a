"""Surgeon trajectory estimator: where a tool is, where it goes, how sure that is.

Section 2.2 of the paper (Figure 2): from the tool's tracked position the estimator
finds "its trajectory thanks to the velocity and acceleration parameters", for the
local planner. The paper gives no equations; here a Kalman filter over Singer's model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import ValueProducer

from systems.auto_guidance.optical_tracker import NEVER, MarkerBody
from systems.auto_guidance.shaft_fulcrum import ShaftFulcrum
from systems.auto_guidance.singer import (
    Covariance,
    correct_covariance,
    gains,
    predict_covariance,
)
from systems.common.block import Block


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


class TipFilter:
    """The estimator's algorithm; all that changes is in the state vector.

    State (29): p, v, a (9), their covariance (6, see `singer`), the fulcrum's filter
    (12, see `shaft_fulcrum`), time of the last good frame in s (1), and the variance
    of the tip that comes from the fulcrum's own error (1).
    """

    def __init__(self, params: TrajectoryEstimatorParams) -> None:
        params.check()
        self._fulcrum = ShaftFulcrum(
            params.body,
            params.fulcrum,
            (params.wall_height, params.sigma_wall),
            (params.depth, params.sigma_depth),
            params.fulcrum_drift,
            params.gate,
        )
        self._alpha = 1.0 / params.acceleration_time
        self._sigma_a = params.sigma_acceleration
        self._sigma_v = params.sigma_velocity
        self._var_tremor = params.tremor_rms**2 / 3.0
        self._gate2 = params.gate**2
        self._sigma_limit = params.sigma_limit
        self._age_limit = params.age_limit

    def initial(self) -> list[float]:
        """The state before the first frame."""
        return [0.0] * 15 + self._fulcrum.initial() + [NEVER, 0.0]

    def absorb(self, x: list[float], m: Sequence[float]) -> list[float]:
        """The state after a measurement; the same state if there is nothing new.

        Args:
            x: State (29).
            m: p_WP, u_W, frame time, valid (8); refused if it is old, invalid, not
                finite, or too far from where the tip can be.
        """
        px, py, pz, ux, uy, uz, frame, valid = m
        last = x[27]
        if not valid >= 0.5 or not last < frame < math.inf:
            return x
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        if not 0.9 < length < 1.1 or not math.isfinite(px + py + pz):
            return x
        u = ux / length, uy / length, uz / length
        dt = None if last == NEVER else frame - last
        if dt is None or dt > self._age_limit:
            P: Covariance = (1.0, 0.0, 0.0, self._sigma_v**2, 0.0, self._sigma_a**2)
            mx, my, mz, vx, vy, vz, ax, ay, az = (px, py, pz, *[0.0] * 6)
        else:
            P = self._predict_covariance(x, dt)
            mx, my, mz, vx, vy, vz, ax, ay, az = self._predict_mean(x, dt)
            miss = (px - mx) ** 2 + (py - my) ** 2 + (pz - mz) ** 2
            variance = P[0] + self._fulcrum.var_tip + self._var_tremor + x[28]
            if miss > self._gate2 * variance:
                return x
        lever = self._fulcrum.lever
        c = px - lever * u[0], py - lever * u[1], pz - lever * u[2]
        fulcrum, tip, variance, shared = self._fulcrum.absorb(x[15:27], c, u, dt)
        P, (kp, kv, ka) = correct_covariance(P, variance + self._var_tremor)
        ix, iy, iz = tip[0] - mx, tip[1] - my, tip[2] - mz
        mean = (
            *(mx + kp * ix, my + kp * iy, mz + kp * iz),
            *(vx + kv * ix, vy + kv * iy, vz + kv * iz),
            *(ax + ka * ix, ay + ka * iy, az + ka * iz),
        )
        return [*mean, *P, *fulcrum, frame, shared]

    def predict(self, x: list[float], t: float) -> list[float]:
        """The estimate (17) at time `t` in s, see the port of `TrajectoryEstimator`."""
        age = max(t - x[27], 0.0)
        mean = self._predict_mean(x, min(age, self._age_limit))
        if age > self._age_limit:
            mean = (*mean[:3], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        sigmas = (1.0, 1.0, 1.0)
        if x[27] != NEVER:
            pp, _, _, vv, _, aa = self._predict_covariance(x, age)
            pp += x[28] + self._var_tremor
            sigmas = (math.sqrt(pp), math.sqrt(vv), math.sqrt(aa))
        known = age <= self._age_limit and sigmas[0] <= self._sigma_limit
        return [*mean, x[15], x[16], x[17], *sigmas, 1.0 if known else 0.0, age]

    def _predict_covariance(self, x: list[float], dt: float) -> Covariance:
        now = (x[9], x[10], x[11], x[12], x[13], x[14])
        return predict_covariance(now, dt, self._alpha, self._sigma_a)

    def _predict_mean(self, x: list[float], dt: float) -> tuple[float, ...]:
        kp, kv, ka = gains(dt, self._alpha)
        px, py, pz, vx, vy, vz, ax, ay, az = x[:9]
        return (
            *(px + dt * vx + kp * ax, py + dt * vy + kp * ay, pz + dt * vz + kp * az),
            *(vx + kv * ax, vy + kv * ay, vz + kv * az),
            *(ka * ax, ka * ay, ka * az),
        )


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
        self._filter = TipFilter(params)
        self._measurement = self.vector_in(
            "measurement", [0.05, 0.0, -0.12, 0.0, 0.0, -1.0, 0.0, 1.0]
        )
        self.DeclareDiscreteState(np.array(self._filter.initial()))
        # The state with the present measurement in it: outputs and update share it.
        self._absorbed: Any = self.DeclareCacheEntry(
            "absorbed",
            ValueProducer(allocate=lambda: Value(object()), calc=self._absorb),
            {self.xd_ticket(), self._measurement.ticket()},
        )
        self.vector_out(
            "estimate",
            17,
            self._calc_estimate,
            {self._absorbed.ticket(), self.time_ticket()},
        )
        self.update_every(params.period, self._state_after)

    def _absorb(self, context: Any, value: Any) -> None:
        state = context.get_discrete_state(0).value().tolist()
        measurement = self._measurement.Eval(context).tolist()
        value.set_value(self._filter.absorb(state, measurement))

    def _state_after(self, context: Any) -> list[float]:
        state: list[float] = self._absorbed.Eval(context)
        return state

    def _calc_estimate(self, context: Any) -> Sequence[float]:
        return self._filter.predict(self._state_after(context), context.get_time())
