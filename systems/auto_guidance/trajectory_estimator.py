"""Surgeon trajectory estimator: where a tool is, where it goes, how sure that is.

Section 2.2 of the paper (Figure 2): from the tool's tracked position the estimator
finds "its trajectory thanks to the velocity and acceleration parameters", for the
local planner. The paper gives no equations; here a Kalman filter over Singer's model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import ValueProducer

from systems.auto_guidance.optical_tracker import NEVER, MarkerBody
from systems.auto_guidance.shaft_fulcrum import (
    PointCovariance,
    lateral_variance,
    measure,
    measure_line,
)
from systems.auto_guidance.singer import (
    correct_covariance,
    gains,
    predict_covariance,
)
from systems.common.block import Block

_NEAREST_FULCRUM = 0.05  # m, from the markers' mean: nearer, it gives no direction


@dataclass
class TrajectoryEstimatorParams:
    """What the estimator takes for granted of a tool, and when it gives up. SI units."""

    # Time between updates in s; the tracker's.
    period: float = 1.0 / 60.0
    # The markers on the tool, as the tracker's.
    body: MarkerBody = field(default_factory=MarkerBody)
    # The hand's acceleration along each axis: standard deviation in m/s^2 and time
    # constant in s.
    sigma_acceleration: float = 0.15
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

    State (26): p, v, a (9), their covariance (6, see `singer`), fulcrum p_WG (3), its
    covariance (6), time of the last good frame in s (1), and the variance of the tip
    that comes from the fulcrum's own error (1).

    The markers' mean is found some eight times better than the direction of the shaft.
    The fulcrum gives a second direction: the shaft runs from the markers' mean through
    it. Both are fused, each weighted by its variance, and so the tip is known several
    times better than it is measured. The error this takes over from the fulcrum is
    slow, so that no filtering reduces it: it is carried beside the covariance.
    """

    def __init__(self, params: TrajectoryEstimatorParams) -> None:
        params.check()
        self.params = params
        self._alpha = 1.0 / params.acceleration_time
        # A millionth of a metre at least: the covariance stays regular without noise.
        self._var_c = max(params.body.sigma_position(), 1e-6) ** 2
        self._var_u = max(params.body.sigma_direction(), 1e-6) ** 2
        self._var_tremor = params.tremor_rms**2 / 3.0
        self._gate2 = params.gate**2

    def initial(self) -> list[float]:
        """The state before the first frame."""
        return [0.0] * 15 + (self.params.fulcrum or [0.0] * 3) + [0.0] * 6 + [NEVER, 0.0]

    def absorb(self, x: list[float], m: Sequence[float]) -> list[float]:
        """The state after a measurement; the same state if there is nothing new.

        Args:
            x: State (26).
            m: p_WP, u_W, frame time, valid (8); refused if it is old, invalid, not
                finite, or too far from where the tip can be.
        """
        px, py, pz, ux, uy, uz, frame, valid = m
        last = x[24]
        if valid < 0.5 or frame <= last or not math.isfinite(px + py + pz):
            return x
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        if not 0.5 < length < 2.0:  # not a unit vector, or not a number
            return x
        ux, uy, uz = ux / length, uy / length, uz / length
        lever = self.params.body.lever
        var_raw = self._var_c + lever * lever * self._var_u + self._var_tremor
        restart = last == NEVER or frame - last > self.params.age_limit
        P: tuple[float, ...]
        if restart:
            mx, my, mz, vx, vy, vz, ax, ay, az = (px, py, pz) + (0.0,) * 6
            P = (1.0, 0.0, 0.0, self.params.sigma_velocity**2, 0.0)
            P += (self.params.sigma_acceleration**2,)
        else:
            dt = frame - last
            mx, my, mz, vx, vy, vz, ax, ay, az = self._ahead(x, dt)
            P = predict_covariance(
                (x[9], x[10], x[11], x[12], x[13], x[14]),
                dt,
                self._alpha,
                self.params.sigma_acceleration,
            )
            ix, iy, iz = px - mx, py - my, pz - mz
            miss = ix * ix + iy * iy + iz * iz
            if miss > self._gate2 * (P[0] + var_raw + x[25]):
                return x
        c = (px - lever * ux, py - lever * uy, pz - lever * uz)
        u = (ux, uy, uz)
        (gx, gy, gz), PG, tip, variance, shared = self._use_fulcrum(x, frame, c, u)
        P, (kp, kv, ka) = correct_covariance(P, variance)
        ix, iy, iz = tip[0] - mx, tip[1] - my, tip[2] - mz
        return [
            mx + kp * ix,
            my + kp * iy,
            mz + kp * iz,
            vx + kv * ix,
            vy + kv * iy,
            vz + kv * iz,
            ax + ka * ix,
            ay + ka * iy,
            az + ka * iz,
            *P,
            gx,
            gy,
            gz,
            *PG,
            frame,
            shared,
        ]

    def predict(self, x: list[float], t: float) -> list[float]:
        """The estimate (17) at time `t` in s, see the port of `TrajectoryEstimator`."""
        limit = self.params.age_limit
        age = max(t - x[24], 0.0)
        mean = self._ahead(x, min(age, limit))
        if age > limit:
            mean = (*mean[:3], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if x[24] == NEVER:
            sigmas = (1.0, 1.0, 1.0)
        else:
            pp, _, _, vv, _, aa = predict_covariance(
                (x[9], x[10], x[11], x[12], x[13], x[14]),
                age,
                self._alpha,
                self.params.sigma_acceleration,
            )
            sqrt = math.sqrt
            sigmas = (sqrt(pp + x[25] + self._var_tremor), sqrt(vv), sqrt(aa))
        known = age <= limit and sigmas[0] <= self.params.sigma_limit
        return [*mean, x[15], x[16], x[17], *sigmas, 1.0 if known else 0.0, age]

    def _ahead(self, x: list[float], dt: float) -> tuple[float, ...]:
        """p, v, a (9) after `dt` in s."""
        kp, kv, ka = gains(dt, self._alpha)
        px, py, pz, vx, vy, vz, ax, ay, az = x[:9]
        return (
            px + dt * vx + kp * ax,
            py + dt * vy + kp * ay,
            pz + dt * vz + kp * az,
            vx + kv * ax,
            vy + kv * ay,
            vz + kv * az,
            ka * ax,
            ka * ay,
            ka * az,
        )

    def _use_fulcrum(
        self,
        x: list[float],
        frame: float,
        c: tuple[float, float, float],
        u: tuple[float, float, float],
    ) -> tuple[
        tuple[float, float, float], PointCovariance, tuple[float, ...], float, float
    ]:
        """Fuses the shaft's direction with the fulcrum's, and refines the fulcrum.

        Args:
            x: State (26) before the frame.
            frame: The frame's time in s.
            c: Measured mean of the markers in m.
            u: Measured direction of the shaft.

        Returns:
            Fulcrum and its covariance after the frame; the fused tip in m, its
            variance along each axis, and the part of the fulcrum's error in it.
        """
        params = self.params
        lever, var_c, var_u = params.body.lever, self._var_c, self._var_u
        cx, cy, cz = c
        ux, uy, uz = u
        g = (x[15], x[16], x[17])
        P: PointCovariance = (x[18], x[19], x[20], x[21], x[22], x[23])
        if params.fulcrum is None:
            if x[24] == NEVER:
                g, P = self._fulcrum_beforehand(c, u)
            else:
                q = params.fulcrum_drift**2 * (frame - x[24])
                P = (P[0] + q, P[1], P[2], P[3] + q, P[4], P[5] + q)
        dx, dy, dz = g[0] - cx, g[1] - cy, g[2] - cz
        along = dx * ux + dy * uy + dz * uz
        d2 = dx * dx + dy * dy + dz * dz
        var_g = lateral_variance(P, u)
        var_line = var_c + d2 * var_u
        seen = d2 - along * along <= self._gate2 * (var_line + var_g)
        fused = (cx + lever * ux, cy + lever * uy, cz + lever * uz)
        variance = var_c + lever * lever * var_u + self._var_tremor
        shared = 0.0
        if seen and along > _NEAREST_FULCRUM:
            distance = math.sqrt(d2)
            weight = d2 * var_u / (d2 * var_u + var_c + var_g)
            rest, ratio = 1.0 - weight, weight / distance
            wx = rest * ux + ratio * dx
            wy = rest * uy + ratio * dy
            wz = rest * uz + ratio * dz
            scale = lever / math.sqrt(wx * wx + wy * wy + wz * wz)
            fused = (cx + scale * wx, cy + scale * wy, cz + scale * wz)
            ratio *= lever
            lateral = (1.0 - ratio) ** 2 * var_c + (rest * lever) ** 2 * var_u
            variance = max(lateral, var_c) + self._var_tremor
            shared = ratio * ratio * var_g
        if params.fulcrum is None:
            if not seen:  # the tool has another fulcrum now: begin again
                g, P = self._fulcrum_beforehand(c, u)
            g, P = measure_line(g, P, c, u, var_line)
        return g, P, fused, variance, shared

    def _fulcrum_beforehand(
        self, c: tuple[float, float, float], u: tuple[float, float, float]
    ) -> tuple[tuple[float, float, float], PointCovariance]:
        """The fulcrum that is expected of a shaft when nothing else is known."""
        params = self.params
        up = params.body.lever - params.depth
        g = (c[0] + up * u[0], c[1] + up * u[1], c[2] + up * u[2])
        var = params.sigma_depth**2
        P = (var, 0.0, 0.0, var, 0.0, var)
        wall = (0.0, 0.0, 1.0)
        return measure(g, P, wall, params.wall_height, params.sigma_wall**2)


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
        self.DeclareDiscreteState(self._filter.initial())
        # The state with the present measurement in it: outputs and update share it.
        self._absorbed = self.DeclareCacheEntry(
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
        self.update_every(params.period, self._absorbed.Eval)

    def _absorb(self, context: Any, value: Any) -> None:
        state = context.get_discrete_state(0).value().tolist()
        measurement = self._measurement.Eval(context).tolist()
        value.set_value(self._filter.absorb(state, measurement))

    def _calc_estimate(self, context: Any) -> Sequence[float]:
        return self._filter.predict(self._absorbed.Eval(context), context.get_time())
