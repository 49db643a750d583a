"""Surgeon's tool: a straight shaft that the surgeon moves through its fulcrum.

Section 2.1 of the paper (Figure 1): the target tool S and the obstacle tool O enter
through their fulcrums G_S and G_O, and the surgeon moves them as he or she likes.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from systems.auto_guidance.recording import load_recording
from systems.common.block import Block

Motion = Callable[[float], tuple[float, float, float, float, float, float]]
"""Time in s to position in m (x, y, z) and velocity in m/s (x, y, z)."""

_TREMOR_WAVES = 3  # sinusoids for each axis
_LEAST_DEPTH = 0.005  # m, of a tip below its fulcrum


@dataclass
class Push:
    """The surgeon pushes something aside, waits, and withdraws."""

    # When the push begins, in s.
    start: float = 0.0
    # Its direction in W; any length but zero.
    direction: list[float] = field(default_factory=lambda: [1.0, 0.0, 0.0])
    # How far the tip goes, in m.
    distance: float = 0.02
    # Peak speed of the tip, in m/s, out and back (minimum jerk).
    speed: float = 0.04
    # How long it stays out, in s.
    hold: float = 1.0

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        _check_vector("direction", self.direction)
        if not math.hypot(*self.direction) > 0.0:
            raise ValueError(f"push: direction={self.direction} has no length")
        for name in ("start", "distance", "hold"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"push: {name}={value} must be finite and >= 0")
        if not 0.0 < self.speed < math.inf:
            raise ValueError(f"push: speed={self.speed} m/s must be finite and > 0")


@dataclass
class SurgeonToolParams:
    """How one of the surgeon's tools moves. Frame W, z up, SI units."""

    # The fulcrum G, in m.
    p_WG: list[float] = field(default_factory=lambda: [0.08, 0.0, 0.0])
    # Waypoints of the tip: times in s, and points in m. Minimum jerk from each to
    # the next, at rest at each of them, held before the first and after the last.
    times: list[float] = field(default_factory=lambda: [0.0])
    points: list[list[float]] = field(default_factory=lambda: [[0.05, 0.0, -0.12]])
    # A recording (CSV `t,x,y,z`) takes the waypoints' place if its path is given.
    recording: str | None = None
    # Tremor, 8 to 12 Hz: root mean square in three dimensions, in m. A surgeon's
    # is 50e-6 to 200e-6.
    tremor_rms: float = 0.0
    # Chooses the phases and frequencies of the tremor.
    tremor_seed: int = 0
    # Pushes on top of the motion.
    pushes: list[Push] = field(default_factory=list)

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        _check_vector("p_WG", self.p_WG)
        if len(self.times) != len(self.points) or not self.times:
            raise ValueError(
                f"surgeon's tool: {len(self.times)} times for {len(self.points)} "
                f"points; expected one time for every point, and at least one"
            )
        for time, after in zip(self.times, self.times[1:], strict=False):
            if not time < after:
                raise ValueError(
                    f"surgeon's tool: times={self.times} must increase, "
                    f"{after} s follows {time} s"
                )
        if not all(map(math.isfinite, self.times)):
            raise ValueError(f"surgeon's tool: times={self.times} must be finite")
        for point in self.points:
            _check_vector("points", point)
        if not 0.0 <= self.tremor_rms <= 0.002:
            raise ValueError(
                f"surgeon's tool: tremor_rms={self.tremor_rms} m must lie in "
                f"[0, 0.002]; a surgeon's is 50e-6 to 200e-6"
            )
        if self.tremor_seed < 0:
            raise ValueError(
                f"surgeon's tool: tremor_seed={self.tremor_seed} must be >= 0"
            )
        for push in self.pushes:
            push.check()


def _check_vector(name: str, value: Sequence[float]) -> None:
    if len(value) != 3 or not all(map(math.isfinite, value)):
        raise ValueError(
            f"surgeon's tool: {name}={list(value)} must be 3 finite numbers"
        )


def _blend(s: float) -> tuple[float, float]:
    """Minimum jerk from 0 to 1 for s in [0, 1]: value and derivative (Flash 1985)."""
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0
    s2 = s * s
    return s2 * s * (10.0 - 15.0 * s + 6.0 * s2), 30.0 * s2 * (1.0 - s) ** 2


def waypoint_motion(times: list[float], points: list[list[float]]) -> Motion:
    """Minimum jerk from waypoint to waypoint, at rest at each.

    Args:
        times: In s, increasing.
        points: In m, one of three elements for each time.
    """

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        i = bisect_right(times, t)
        if i == 0 or i == len(times):
            x, y, z = points[max(i - 1, 0)]
            return x, y, z, 0.0, 0.0, 0.0
        (x, y, z), (x1, y1, z1) = points[i - 1], points[i]
        span = times[i] - times[i - 1]
        w, dw = _blend((t - times[i - 1]) / span)
        dw /= span
        dx, dy, dz = x1 - x, y1 - y, z1 - z
        return x + w * dx, y + w * dy, z + w * dz, dw * dx, dw * dy, dw * dz

    return motion


def recorded_motion(times: np.ndarray, points: np.ndarray) -> Motion:
    """Interpolates a recording, and holds it at its ends.

    PCHIP: velocity is continuous, and a gap in the recording is bridged without
    overshooting the samples beside it.

    Args:
        times: In s, shape (n,), increasing.
        points: In m, shape (n, 3).
    """
    # Coefficients (cubic first) of each interval as plain floats: 12 in a row.
    coefficients = PchipInterpolator(times, points).c  # (4, n - 1, 3)
    rows = coefficients.transpose(1, 2, 0).reshape(len(times) - 1, 12).tolist()
    knots = times.tolist()
    ends = points[0].tolist(), points[-1].tolist()

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        i = bisect_right(knots, t)
        if i == 0 or i == len(knots):
            x, y, z = ends[i > 0]
            return x, y, z, 0.0, 0.0, 0.0
        a, b, c, d, e, f, g, h, k, m, n, o = rows[i - 1]
        s = t - knots[i - 1]
        return (
            ((a * s + b) * s + c) * s + d,
            ((e * s + f) * s + g) * s + h,
            ((k * s + m) * s + n) * s + o,
            (3.0 * a * s + 2.0 * b) * s + c,
            (3.0 * e * s + 2.0 * f) * s + g,
            (3.0 * k * s + 2.0 * m) * s + n,
        )

    return motion


def push_motion(push: Push) -> Motion:
    """Displacement and velocity of a push: out, hold, and back."""
    length = math.hypot(*push.direction)
    dx, dy, dz = (push.distance * d / length for d in push.direction)
    span = 1.875 * push.distance / push.speed  # 1.875: peak over mean speed
    back = push.start + span + push.hold
    end = back + span

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        if t <= push.start or t >= end:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if t < back:
            w, dw = _blend((t - push.start) / span)
        else:
            w, dw = _blend((end - t) / span)
            dw = -dw
        dw /= span
        return w * dx, w * dy, w * dz, dw * dx, dw * dy, dw * dz

    return motion


def tremor_motion(rms: float, seed: int) -> Motion:
    """Displacement and velocity of a physiological tremor, 8 to 12 Hz.

    Args:
        rms: Root mean square in three dimensions, in m.
        seed: Same seed, same phases and frequencies.
    """
    rng = np.random.default_rng(seed)
    rates = (2.0 * math.pi * rng.uniform(8.0, 12.0, (3, _TREMOR_WAVES))).tolist()
    phases = rng.uniform(0.0, 2.0 * math.pi, (3, _TREMOR_WAVES)).tolist()
    axes = [list(zip(w, p, strict=True)) for w, p in zip(rates, phases, strict=True)]
    amplitude = rms * math.sqrt(2.0 / (3.0 * _TREMOR_WAVES))
    sin, cos = math.sin, math.cos

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        x, y, z = (amplitude * sum([sin(w * t + p) for w, p in a]) for a in axes)
        u, v, w = (amplitude * sum([c * cos(c * t + p) for c, p in a]) for a in axes)
        return x, y, z, u, v, w

    return motion


def tip_motion(params: SurgeonToolParams) -> Motion:
    """The tip's motion p_WP(t), v_WP(t): all parts together.

    Raises:
        ValueError: If a parameter makes no sense, the recording cannot be used, or
            the tip would come to its fulcrum or above it.
    """
    params.check()
    times, points = params.times, params.points
    if params.recording is None:
        base = waypoint_motion(times, points)
        key_times = list(times)
    else:
        recorded, path = load_recording(params.recording)
        base = recorded_motion(recorded, path)
        key_times = recorded.tolist()
    extras = [push_motion(push) for push in params.pushes]
    if params.tremor_rms > 0.0:
        extras.append(tremor_motion(params.tremor_rms, params.tremor_seed))

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        x, y, z, u, v, w = base(t)
        for extra in extras:
            dx, dy, dz, du, dv, dw = extra(t)
            x, y, z, u, v, w = x + dx, y + dy, z + dz, u + du, v + dv, w + dw
        return x, y, z, u, v, w

    # The tip is highest at a waypoint, at a sample, or while a push is held.
    for push in params.pushes:
        key_times.append(push.start + 1.875 * push.distance / push.speed)
        key_times.append(key_times[-1] + push.hold)
    ceiling = params.p_WG[2] - _LEAST_DEPTH
    for t in key_times:
        z = motion(t)[2]
        if z > ceiling:
            source = params.recording or "its waypoints and pushes"
            raise ValueError(
                f"surgeon's tool: at t={t:.3f} s {source} put the tip at z={z:.4f} m, "
                f"at or above its fulcrum (z={params.p_WG[2]:.4f} m); the highest "
                f"valid z is {ceiling:.4f} m"
            )
    return motion


class SurgeonTool(Block):
    """A tool in the surgeon's hand, always through its fulcrum (section 2.1).

    A pure function of time: it has no state, and the same parameters give the same
    motion. Port ``shaft`` emits the tool's true shaft (6): tip p_WP in m and unit
    vector u_W along the shaft, from outside towards the tip, both in the world frame
    W. Port ``tip_velocity`` emits the tip's true velocity v_WP (3) in m/s in W, for
    the log.

    Args:
        params: How the tool moves; waypoints, or a recording, tremor, pushes.

    Raises:
        ValueError: If `params` make no sense, see `tip_motion`.
    """

    def __init__(self, params: SurgeonToolParams | None = None) -> None:
        super().__init__()
        params = params or SurgeonToolParams()
        self._motion = tip_motion(params)
        self._p_WG = tuple(params.p_WG)
        time = {self.time_ticket()}
        self.vector_out("shaft", 6, self._calc_shaft, time)
        self.vector_out("tip_velocity", 3, self._calc_velocity, time)

    def _calc_shaft(self, context: Any) -> Sequence[float]:
        x, y, z, _, _, _ = self._motion(context.get_time())
        gx, gy, gz = self._p_WG
        ux, uy, uz = x - gx, y - gy, z - gz
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        return x, y, z, ux / length, uy / length, uz / length

    def _calc_velocity(self, context: Any) -> Sequence[float]:
        return self._motion(context.get_time())[3:]
