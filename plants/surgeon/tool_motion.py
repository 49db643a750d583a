"""How a surgeon's hand moves a tool's tip: waypoints, a recording, pushes, tremor.

A motion is a function of time that gives position and velocity; motions add up. It
is a sum of piecewise polynomials and sinusoids, and all of it is in arrays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from systems.common.compiled import compiled
from systems.common.parameter import Rules, parameter

_DEGREE = 5
_TREMOR_WAVES = 3  # sinusoids; each axis has its own phases


@dataclass
class Push:
    """The surgeon pushes something aside, waits, and withdraws."""

    start: float = parameter(0.0, "when it begins", "s", least=0, most=1e4)
    direction: list[float] = parameter(
        [1.0, 0.0, 0.0], "in W, of any length", least=-1e3, most=1e3, shape=(3,)
    )
    distance: float = parameter(0.02, "how far the tip goes", "m", least=0, most=0.3)
    # Minimum jerk, out and back.
    speed: float = parameter(0.04, "peak of the tip's", "m/s", above=0, most=1)
    hold: float = parameter(1.0, "how long it stays out", "s", least=0, most=1e4)

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield any(self.direction), "direction", "3 numbers, not all 0"

    def span(self) -> float:
        """Time it takes the tip to go out, or back, in s."""
        return 1.875 * self.distance / self.speed  # 1.875: peak over mean speed


@compiled
def evaluate(
    knots: np.ndarray, pieces: np.ndarray, waves: np.ndarray, t: float
) -> tuple[float, float, float, float, float, float]:
    """Position in m (x, y, z) and velocity in m/s of a motion at time t in s.

    Args:
        knots: Of each path, in s, increasing; padded with infinities (paths x n).
        pieces: Coefficients, constant first, of the time since the knot before
            (paths x n + 1 x 3 x 6).
        waves: Amplitude in m, rate in rad/s and three phases in rad (m x 5).
        t: In s.
    """
    x = np.zeros(6)
    for k in range(len(knots)):
        i = int(np.searchsorted(knots[k], t, side="right"))
        s = t - knots[k, max(i - 1, 0)]
        for axis in range(3):
            c: Any = pieces[k, i, axis]
            value = slope = 0.0
            for power in range(_DEGREE, -1, -1):
                slope = slope * s + value
                value = value * s + c[power]
            x[axis] += value
            x[3 + axis] += slope
    for wave in waves:
        for axis in range(3):
            angle = wave[1] * t + wave[2 + axis]
            x[axis] += wave[0] * math.sin(angle)
            x[3 + axis] += wave[0] * wave[1] * math.cos(angle)
    return x[0], x[1], x[2], x[3], x[4], x[5]


@dataclass(frozen=True)
class Motion:
    """A motion; call it with a time in s for position in m and velocity in m/s.

    Attributes:
        knots: As `evaluate` takes them.
        pieces: Likewise.
        waves: Likewise.
    """

    knots: np.ndarray
    pieces: np.ndarray
    waves: np.ndarray

    def __call__(self, t: float) -> tuple[float, float, float, float, float, float]:
        """Position (x, y, z) and velocity (x, y, z) at time t."""
        return evaluate(self.knots, self.pieces, self.waves, t)


def total(motions: Sequence[Motion]) -> Motion:
    """The sum of motions."""
    count = sum(len(motion.knots) for motion in motions)
    most = max(motion.knots.shape[1] for motion in motions)
    knots = np.full((count, most), np.inf)
    pieces = np.zeros((count, most + 1, 3, _DEGREE + 1))
    row = 0
    for motion in motions:
        n, m = motion.knots.shape
        knots[row : row + n, :m] = motion.knots
        pieces[row : row + n, : m + 1] = motion.pieces
        row += n
    return Motion(knots, pieces, np.vstack([motion.waves for motion in motions]))


def _path(times: Sequence[float], pieces: np.ndarray) -> Motion:
    knots = np.array(times, float)[None]
    return Motion(knots, pieces[None], np.zeros((0, 5)))


def waypoint_motion(times: Sequence[float], points: Sequence[Any]) -> Motion:
    """Minimum jerk from waypoint to waypoint, at rest at each (Flash 1985).

    Args:
        times: In s, increasing.
        points: In m, one of three elements for each time.
    """
    n = len(times)
    pieces = np.zeros((n + 1, 3, _DEGREE + 1))
    pieces[0, :, 0] = points[0]
    pieces[1:, :, 0] = points
    for i in range(n - 1):
        span = times[i + 1] - times[i]
        way = np.subtract(points[i + 1], points[i])
        for power, share in ((3, 10.0), (4, -15.0), (5, 6.0)):
            pieces[i + 1, :, power] = share * way / span**power
    return _path(times, pieces)


def recorded_motion(times: np.ndarray, points: np.ndarray) -> Motion:
    """Interpolates a recording, and holds it at its ends.

    PCHIP: velocity is continuous, and a gap in the recording is bridged without
    overshooting the samples beside it.

    Args:
        times: In s, shape (n,), increasing.
        points: In m, shape (n, 3).
    """
    n = len(times)
    pieces = np.zeros((n + 1, 3, _DEGREE + 1))
    pieces[0, :, 0], pieces[n, :, 0] = points[0], points[-1]
    coefficients = PchipInterpolator(times, points).c  # cubic first, (4, n - 1, 3)
    pieces[1:n, :, :4] = coefficients[::-1].transpose(1, 2, 0)
    return _path(times.tolist(), pieces)


def push_motion(push: Push) -> Motion:
    """Displacement and velocity of a push: out, hold, and back."""
    reach = push.distance / math.hypot(*push.direction) * np.array(push.direction)
    span, rest = push.span(), np.zeros(3)
    times, points = [push.start], [rest]
    if span > 0.0:
        times += [push.start + span]
        points += [reach]
        if push.hold > 0.0:
            times += [push.start + span + push.hold]
            points += [reach]
        times += [times[-1] + span]
        points += [rest]
    return waypoint_motion(times, points)


def tremor_motion(rms: float, seed: int) -> Motion:
    """Displacement and velocity of a physiological tremor, 8 to 12 Hz.

    Args:
        rms: Root mean square in three dimensions, in m.
        seed: Same seed, same phases and frequencies.
    """
    rng = np.random.default_rng(seed)
    rates = 2.0 * math.pi * rng.uniform(8.0, 12.0, (_TREMOR_WAVES, 1))
    phases = rng.uniform(0.0, 2.0 * math.pi, (_TREMOR_WAVES, 3))
    amplitude = rms * math.sqrt(2.0 / (3.0 * _TREMOR_WAVES))
    amplitudes = np.full((_TREMOR_WAVES, 1), amplitude)
    pieces = np.zeros((0, 1, 3, _DEGREE + 1))
    return Motion(np.zeros((0, 0)), pieces, np.hstack([amplitudes, rates, phases]))
