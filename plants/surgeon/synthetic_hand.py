"""A synthetic hand: a surgeon's tip motion with the tails of a real one.

A real hand moves in strokes with bell-shaped speed (minimum jerk) and rests in between.
Most strokes are short and slow, a few long and fast: over recordings of a real hand at
30 Hz the speed is 11 mm/s in the mean, below 62 mm/s for 99 % of the time, and up to
250 mm/s. Here a stroke's peak speed is log-normal up to `top_speed`. It works near
where it is, reaches for another place, goes in and out along its own shaft through the
whole depth, or slides along another tool's shaft.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from systems.common.parameter import Rules, parameter

_RATE = 30.0  # samples in a second, as a tracker's recording has
_ASIDE = 0.0055  # m, of the axes of a tool that slides along another
_LEAST_STROKE = 0.25  # s
_TREMOR_RMS = 100e-6  # m, in three dimensions


@dataclass
class SyntheticHand:
    """A hand whose strokes are drawn; seed 0 is none."""

    seed: int = parameter(0, "of the strokes; 0 for none", least=0, most=2**63)
    speed: float = parameter(
        0.018, "median of the strokes' peak speeds", "m/s", above=0, most=0.25
    )
    spread: float = parameter(1.2, "deviation of their logarithm", "1", least=0, most=2)
    top_speed: float = parameter(0.25, "of any stroke", "m/s", above=0, most=1)
    reach: float = parameter(
        0.06, "how far from its first place it works", "m", above=0, most=0.2
    )
    least_depth: float = parameter(
        0.03, "of the tip below its fulcrum", "m", least=0.005, most=0.3
    )
    most_depth: float = parameter(0.16, "likewise", "m", above=0, most=0.4)

    def rules(self) -> Rules:
        """What must hold across fields."""
        below = f"less than most_depth={self.most_depth} m"
        yield self.least_depth < self.most_depth, "least_depth", below


class Line(NamedTuple):
    """A tool that stands, to slide along: tip and fulcrum, m (3)."""

    tip: np.ndarray
    fulcrum: np.ndarray


def synthetic_motion(
    hand: SyntheticHand,
    p_WG: np.ndarray,
    start: np.ndarray,
    duration: float,
    other: Line | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The tip's motion.

    Args:
        hand: Its strokes.
        p_WG: The tool's fulcrum (3) [m].
        start: The tip's first place (3) [m].
        duration: In s.
        other: A tool to slide along; none if None.

    Returns:
        Times in s, shape (n,), and p_WP in m, shape (n, 3).
    """
    rng = np.random.default_rng(hand.seed)
    fulcrum, home = np.asarray(p_WG, float), np.asarray(start, float)
    here, clock = home.copy(), float(rng.exponential(0.5))
    strokes: list[tuple[float, float, np.ndarray]] = []  # start, duration, way
    to_do: list[np.ndarray] = []  # places that a slide still goes to
    while clock < duration:
        goal = to_do.pop(0) if to_do else None
        if goal is None:
            goal, to_do = _next_place(rng, hand, fulcrum, home, here, other)
        goal = _within(hand, fulcrum, goal)
        way = goal - here
        length = float(np.linalg.norm(way))
        if length < 1e-4:
            continue
        peak = hand.speed * math.exp(rng.normal(0.0, hand.spread))
        # A long way is not gone at a snail's pace.
        peak = min(hand.top_speed, max(peak, 0.2 * length))
        time = max(_LEAST_STROKE, 1.875 * length / peak)
        strokes.append((clock, time, way))
        here = goal
        rest = rng.exponential(2.0 if rng.random() < 0.2 else 0.3)
        clock += time + rest
    times = np.arange(round(duration * _RATE) + 1) / _RATE
    path = np.tile(home, (len(times), 1))
    for begin, time, way in strokes:
        s = np.clip((times - begin) / time, 0.0, 1.0)
        path += (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * way
    for axis in range(3):
        for hertz, phase in rng.uniform((8.0, 0.0), (12.0, 2.0 * math.pi), (3, 2)):
            wave = np.sin(2.0 * math.pi * hertz * times + phase)
            path[:, axis] += math.sqrt(2.0) / 3.0 * _TREMOR_RMS * wave
    return times, path


def _next_place(
    rng: np.random.Generator,
    hand: SyntheticHand,
    fulcrum: np.ndarray,
    home: np.ndarray,
    here: np.ndarray,
    other: Line | None,
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Where the tip goes next, and where after that."""
    what = rng.random()
    if what < 0.60:  # works where it is
        return here + rng.normal(0.0, 0.008, 3), []
    if what < 0.80:  # another place
        return home + hand.reach * rng.uniform(-1.0, 1.0, 3), []
    if what < 0.92 or other is None:  # in and out
        inwards = (here - fulcrum) / np.linalg.norm(here - fulcrum)
        depth = rng.uniform(hand.least_depth, hand.most_depth)
        return fulcrum + depth * inwards, []
    shaft = other.fulcrum - other.tip
    length = float(np.linalg.norm(shaft))
    aside = np.cross(shaft, fulcrum - other.tip)
    aside *= _ASIDE / max(float(np.linalg.norm(aside)), 1e-9)
    first, last = rng.uniform(0.02, max(0.021, length - 0.03), 2)
    along = shaft / length
    return other.tip + aside + first * along, [other.tip + aside + last * along]


def _within(hand: SyntheticHand, fulcrum: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """The place nearest on the goal's line that the tool can have its tip at."""
    way = goal - fulcrum
    # No flatter under the wall than 20 degrees.
    across = float(np.hypot(way[0], way[1]))
    way[2] = min(way[2], -0.36 * across, -1e-3)
    depth = float(np.linalg.norm(way))
    wanted = min(max(depth, hand.least_depth), hand.most_depth)
    return fulcrum + wanted / depth * way
