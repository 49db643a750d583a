"""Random scenes in which the obstacle tool O is in the robot's way.

The recipe: a dome of 100 to 120 mm radius over a floor at z = -65 mm (frame W
here has its origin in the dome's center). The fulcrums G_R and G_O lie on the
dome within 65 degrees of its top, 60 mm or more apart. Start tip, target and O's
tip lie inside, 80 to 160 mm from their fulcrums, and the way is 30 mm or longer.
Tools are 5 mm thick.

- "standing", "moving": the straight motion touches O. The start pose is clear of O by
  5 mm (10 where O moves), the final pose by 3 mm. A standing O is 26.5 mm or more from
  G_R. A moving O's tip wanders between random points for 7 s at a speed of 10 to
  60 mm/s drawn for the scene, with 400 mm/s^2, always 30 mm or more from G_R, and comes
  to rest where it leaves the final pose free.
- "blocked": O stands on the target's own line, within D_safe of the final pose, for
  6 s; then it leaves at 40 mm/s for a place that frees it.
- "hands": a "moving" scene whose O is in a synthetic hand for 20 s, with the tails of a
  real one (`plants.surgeon.synthetic_hand`); it may go anywhere, S's shaft to slide
  along stands at the target.
- "crowded": one or two more tools stand in the cavity besides the standing one; start
  and final pose are clear of all, and all leave 26.5 mm at G_R.

A scene depends on the seed, the kind and its number only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin, sqrt

import numpy as np

from plants.surgeon.synthetic_hand import Line, SyntheticHand, synthetic_motion
from plants.surgeon.tool_motion import Motion, recorded_motion
from systems.common.geometry import (
    Vector,
    along,
    closest_on_segment,
    closest_points,
    norm,
    segment_triangle_distance,
    sub,
)

CONTACT = 0.005
"""Distance of the axes at contact, m: two radii of 2.5 mm."""

_STREAMS = {"standing": 0, "moving": 1, "blocked": 11, "crowded": 12, "hands": 13}
KINDS = tuple(_STREAMS)
_WANDER_TIME = 7.0
_ACCELERATION = 0.4
_BLOCKED_TIME = 6.0
_LEAVING_SPEED = 0.04
_FREE = CONTACT + 0.003
_BLOCKED = 0.007
_FROM_G_R = 0.0265
_HAND_TIME = 20.0
_TRIES = 1000
_FEW_TRIES = 300


@dataclass(frozen=True)
class Leg:
    """A straight rest-to-rest motion with a trapezoid of speed.

    Attributes:
        start: Time of departure, s.
        p0: From, m.
        p1: To, m.
        speed: Cruising speed, m/s.
    """

    start: float
    p0: Vector
    p1: Vector
    speed: float

    def _shape(self) -> tuple[float, float, float]:
        """(length, peak speed, duration)."""
        length = norm(sub(self.p1, self.p0))
        peak = min(self.speed, sqrt(_ACCELERATION * length))
        return length, peak, length / peak + peak / _ACCELERATION if length else 0.0

    @property
    def end(self) -> float:
        """Time of arrival, s."""
        return self.start + self._shape()[2]

    def shortened(self, end: float) -> "Leg":
        """The same way, only as far as brings it to rest at the time `end`."""
        left = end - self.start
        ramp = self.speed / _ACCELERATION
        if left >= 2.0 * ramp:
            way = self.speed * (left - ramp)
        else:
            way = _ACCELERATION * (0.5 * left) ** 2
        d = sub(self.p1, self.p0)
        return Leg(self.start, self.p0, along(self.p0, way / norm(d), d), self.speed)

    def at(self, time: float) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and acceleration at `time`."""
        length, peak, duration = self._shape()
        t = min(max(time - self.start, 0.0), duration)
        ramp = peak / _ACCELERATION
        if t < ramp:
            way, v, a = 0.5 * _ACCELERATION * t * t, _ACCELERATION * t, _ACCELERATION
        elif t <= duration - ramp:
            way, v, a = peak * (t - 0.5 * ramp), peak, 0.0
        else:
            left = duration - t
            way = length - 0.5 * _ACCELERATION * left * left
            v, a = _ACCELERATION * left, -_ACCELERATION
        if not self.start < time < self.start + duration:
            v, a = 0.0, 0.0
        zero = (0.0, 0.0, 0.0)
        if length == 0.0:
            return self.p0, zero, zero
        d = sub(self.p1, self.p0)
        return (
            along(self.p0, way / length, d),
            along(zero, v / length, d),
            along(zero, a / length, d),
        )


@dataclass(frozen=True)
class Scene:
    """One scene.

    Attributes:
        p_WGr: The robot's fulcrum, m.
        p_WPr: The robot's tip at the start, m.
        p_WPs: The target, m.
        p_WGo: The obstacle tool's fulcrum, m.
        legs: The motion of its tip; a single one of zero length if it stands.
        others: Further tools that stand, tip and fulcrum of each, m.
        hand: The motion of O's tip in the place of legs.
    """

    p_WGr: Vector
    p_WPr: Vector
    p_WPs: Vector
    p_WGo: Vector
    legs: list[Leg]
    others: tuple[tuple[Vector, Vector], ...] = ()
    hand: Motion | None = None

    @property
    def rest_time(self) -> float:
        """From when on O rests, s."""
        return _HAND_TIME if self.hand else self.legs[-1].end

    def obstacle_tip(self, time: float) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and acceleration of O's tip."""
        if self.hand:
            x, y, z, vx, vy, vz = self.hand(time)
            return (x, y, z), (vx, vy, vz), (0.0, 0.0, 0.0)
        for leg in self.legs:
            if time < leg.end:
                return leg.at(time)
        return self.legs[-1].at(time)


def scene(kind: str, seed: int, number: int) -> Scene:
    """Draws a scene.

    Args:
        kind: One of KINDS.
        seed: The set's seed.
        number: Of the scene in its set.

    Raises:
        ValueError: If there is no such kind.
    """
    if kind not in KINDS:
        raise ValueError(f"kind={kind!r} must be one of {', '.join(KINDS)}")
    rng = np.random.default_rng([seed, _STREAMS[kind], number])
    if kind == "crowded":
        return _draw_crowded(rng, seed, number)
    while True:
        drawn = _draw_blocked(rng) if kind == "blocked" else _draw(rng, kind)
        if drawn is not None:
            return drawn


def _draw(rng: np.random.Generator, kind: str) -> Scene | None:
    """One try; None if it breaks a rule."""
    dome = rng.uniform(0.1, 0.12)
    g_r, g_o = _draw_fulcrum(rng, dome), _draw_fulcrum(rng, dome)
    if norm(sub(g_r, g_o)) < 0.06:
        return None
    start, goal, tip = (_draw_tip(rng, dome, g) for g in (g_r, g_r, g_o))
    if norm(sub(goal, start)) < 0.03:
        return None
    if segment_triangle_distance(g_o, tip, g_r, start, goal) >= CONTACT:
        return None
    moving = kind in ("moving", "hands")
    room, from_g_r = (0.01, 0.03) if moving else (0.005, _FROM_G_R)
    if not _stands_well(g_r, g_o, tip, start, room, from_g_r):
        return None
    if kind == "hands":
        return _in_a_hand(rng, dome, Scene(g_r, start, goal, g_o, []), tip)
    if moving:
        legs = _wander(rng, dome, g_o, tip, g_r, goal, from_g_r)
        return Scene(g_r, start, goal, g_o, legs) if legs else None
    if closest_points(g_r, goal, g_o, tip).distance < _FREE:
        return None
    return Scene(g_r, start, goal, g_o, [Leg(0.0, tip, tip, 1.0)])


def _in_a_hand(
    rng: np.random.Generator, dome: float, base: Scene, tip: Vector
) -> Scene:
    """O in a hand that is drawn, and S's shaft beside it."""
    g_s = _draw_fulcrum(rng, dome)
    hand = SyntheticHand(seed=int(rng.integers(1, 2**31)))
    line = Line(np.array(base.p_WPs), np.array(g_s))
    times, path = synthetic_motion(
        hand, np.array(base.p_WGo), np.array(tip), _HAND_TIME, line
    )
    return replace(base, hand=recorded_motion(times, path))


def _draw_blocked(rng: np.random.Generator) -> Scene | None:
    """One try; None if it breaks a rule."""
    dome = rng.uniform(0.1, 0.12)
    g_r, g_o = _draw_fulcrum(rng, dome), _draw_fulcrum(rng, dome)
    if norm(sub(g_r, g_o)) < 0.06:
        return None
    start, goal = _draw_tip(rng, dome, g_r), _draw_tip(rng, dome, g_r)
    if norm(sub(goal, start)) < 0.03:
        return None
    for _ in range(_FEW_TRIES):
        tip = _draw_tip(rng, dome, g_o)
        rho = closest_points(g_r, goal, g_o, tip).distance
        if rho < _BLOCKED and _stands_well(g_r, g_o, tip, start):
            break
    else:
        return None
    for _ in range(_FEW_TRIES):
        away = _draw_tip(rng, dome, g_o)
        leg = Leg(_BLOCKED_TIME, tip, away, _LEAVING_SPEED)
        clear = closest_points(g_r, goal, g_o, away).distance >= _BLOCKED + 0.004
        between = [leg.at(_BLOCKED_TIME + 0.1 * k)[0] for k in range(50)]
        if clear and all(_far_from(g_r, g_o, p, 0.03) for p in between):
            stand = Leg(0.0, tip, tip, _LEAVING_SPEED)
            return Scene(g_r, start, goal, g_o, [stand, leg])
    return None


def _draw_crowded(rng: np.random.Generator, seed: int, number: int) -> Scene:
    """A standing scene with one or two more tools."""
    more = 1 + number % 2
    k = number
    while True:
        base = scene("standing", seed + 1000, k)
        k += 100_000
        others: list[tuple[Vector, Vector]] = []
        dome = norm(base.p_WGr)
        for _ in range(_FEW_TRIES):
            g = _draw_fulcrum(rng, dome)
            tip = _draw_tip(rng, dome, g)
            taken = [base.p_WGr, base.p_WGo, *(other[1] for other in others)]
            if any(norm(sub(g, one)) < 0.04 for one in taken):
                continue
            free = closest_points(base.p_WGr, base.p_WPs, g, tip).distance >= _FREE
            if free and _stands_well(base.p_WGr, g, tip, base.p_WPr):
                others.append((tip, g))
            if len(others) == more:
                return replace(base, others=tuple(others))


def _far_from(g_r: Vector, g_o: Vector, tip: Vector, distance: float) -> bool:
    return closest_on_segment(g_r, g_o, tip)[1] >= distance


def _stands_well(
    g_r: Vector,
    g_o: Vector,
    tip: Vector,
    pose: Vector,
    room: float = 0.005,
    from_g_r: float = _FROM_G_R,
) -> bool:
    """Whether a tool is clear of R's pose and of its fulcrum."""
    clear = closest_points(g_r, pose, g_o, tip).distance >= CONTACT + room
    return clear and _far_from(g_r, g_o, tip, from_g_r)


def _draw_fulcrum(rng: np.random.Generator, dome: float) -> Vector:
    """A point on the dome, even over the cap of 65 degrees."""
    z = rng.uniform(cos(65.0 * pi / 180.0), 1.0)
    azimuth = rng.uniform(0.0, 2.0 * pi)
    r = sqrt(1.0 - z * z)
    return dome * r * cos(azimuth), dome * r * sin(azimuth), dome * z


def _draw_tip(rng: np.random.Generator, dome: float, p_WG: Sequence[float]) -> Vector:
    """A point inside, even in volume, 80 to 160 mm from its fulcrum."""
    while True:
        x, y = rng.uniform(-dome, dome, 2)
        z = rng.uniform(-0.065, dome)
        p = (float(x), float(y), float(z))
        if norm(p) <= dome and 0.08 <= norm(sub(p, p_WG)) <= 0.16:
            return p


def _wander(
    rng: np.random.Generator,
    dome: float,
    g_o: Vector,
    tip: Vector,
    g_r: Vector,
    goal: Vector,
    from_g_r: float,
) -> list[Leg]:
    """Legs between random points for 7 s, the last one to a place out of the way.

    Empty if none is found: O may stand where every way leads too close to G_R.
    """
    speed = float(rng.uniform(0.01, 0.06))
    legs: list[Leg] = []
    time = 0.0
    for _ in range(_TRIES):
        p0 = legs[-1].p1 if legs else tip
        leg = Leg(time, p0, _draw_tip(rng, dome, g_o), speed)
        last = leg.end >= _WANDER_TIME
        if last:
            leg = leg.shortened(_WANDER_TIME)
        way = sub(leg.p1, p0)
        if not all(
            _far_from(g_r, g_o, along(p0, k / 20, way), from_g_r) for k in range(21)
        ):
            continue
        if last and closest_points(g_r, goal, g_o, leg.p1).distance < _FREE:
            continue
        legs.append(leg)
        time = leg.end
        if last:
            return legs
    return []
