"""How a surgeon's hand moves a tool's tip: waypoints, a recording, pushes, tremor.

A motion is a function of time that gives position and velocity; motions add up.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
import math

import numpy as np
from scipy.interpolate import PchipInterpolator

Motion = Callable[[float], tuple[float, float, float, float, float, float]]
"""Time in s to position in m (x, y, z) and velocity in m/s (x, y, z)."""

_TREMOR_WAVES = 3  # sinusoids; each axis has its own phases


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

    def span(self) -> float:
        """Time it takes the tip to go out, or back, in s."""
        return 1.875 * self.distance / self.speed  # 1.875: peak over mean speed

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        length = math.hypot(*self.direction)
        if len(self.direction) != 3 or not 0.0 < length < math.inf:
            raise ValueError(
                f"push: direction={self.direction} must be 3 finite numbers, not all 0"
            )
        for name in ("start", "distance", "hold"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"push: {name}={value} must be finite and >= 0")
        if not 0.0 < self.speed < math.inf:
            raise ValueError(f"push: speed={self.speed} m/s must be finite and > 0")


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
    span = push.span()
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
    rates = 2.0 * math.pi * rng.uniform(8.0, 12.0, (_TREMOR_WAVES, 1))
    phases = rng.uniform(0.0, 2.0 * math.pi, (_TREMOR_WAVES, 3))
    waves = np.hstack([rates, phases]).tolist()
    amplitude = rms * math.sqrt(2.0 / (3.0 * _TREMOR_WAVES))
    sin, cos = math.sin, math.cos

    def motion(t: float) -> tuple[float, float, float, float, float, float]:
        x = y = z = u = v = w = 0.0
        for rate, a, b, c in waves:
            k, turn = amplitude * rate, rate * t
            a, b, c = a + turn, b + turn, c + turn
            x += amplitude * sin(a)
            y += amplitude * sin(b)
            z += amplitude * sin(c)
            u += k * cos(a)
            v += k * cos(b)
            w += k * cos(c)
        return x, y, z, u, v, w

    return motion
