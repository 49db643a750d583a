"""The way of a camera to another place: what is seen on it, and whether it is clear.

A tool goes from where it is towards where it is expected, and may stop anywhere: hands
slow down sooner than a straight line of constant speed says, and where they stop is
not known. So a place is judged by all that a shaft sweeps, a triangle under its
fulcrum, and a way by where camera and tools are at each time, for every part of the
time ahead in which the tools may stop. Between two times the ray from the lens to a tip
sweeps a triangle, too: what goes through that has hidden the tip.
"""

from math import exp
from typing import Any

import numpy as np

from plants.organs.distance import Organs, shaft_distance
from systems.common.compiled import compiled
from systems.common.geometry import (
    along,
    closest_points,
    norm,
    row_of,
    segment_triangle_distance,
    sub,
    unit,
    xyz,
)
from systems.common.signal import Vector
from systems.common.signals import ViewCone
from systems.motion.sight import SHAFT_RADIUS, SPARED, swept_margin

SCOPE = 0.005
"""Radius of the endoscope, m."""
THERE = 0.002
"""So near to its place the camera has arrived, m."""
_BARELY = 0.01
"""With less a tip counts as lost: tools and camera are not just where expected, rad."""
PARTS = 5
"""Of the time ahead, looked at one by one."""


@compiled
def seen_from(scope: Any, p: Vector) -> ViewCone:
    """What the camera sees with its tip at p."""
    return ViewCone(p, unit(sub(p, xyz(scope.p_WG, 0))), scope.half_angle)


@compiled
def least_margin(
    view: ViewCone,
    shafts: np.ndarray,
    later: np.ndarray,
    organs: Organs,
    enough: float,
) -> float:
    """The least margin of both tips wherever tools go from `shafts` to `later`, rad.

    Args:
        view: What the camera sees.
        shafts: Tools, rows of fulcrum and tip (n, 6), R first, then S, m.
        later: The same afterwards.
        organs: The organs.
        enough: More is of no interest, rad.
    """
    margin = enough
    for i in range(2):
        margin = min(
            margin, swept_margin(view, i, shafts, shafts, later, organs, margin)
        )
        if margin > 0.0:
            more = swept_margin(view, i, later, shafts, later, organs, margin)
            margin = min(margin, more)
        if margin <= 0.0:
            return margin
    return margin


@compiled
def share_at(scope: Any, way: float, time: float) -> float:
    """What share of a way the camera, at rest first, has gone after a time in s.

    It goes at `max_speed` and, near the end, at `rate` times what is left.
    """
    slow = min(way, scope.max_speed / scope.rate)
    begun = 0.5 * scope.rate * slow / scope.max_acceleration
    time = max(0.0, time - begun)
    fast = (way - slow) / scope.max_speed
    if time <= fast:
        return scope.max_speed * time / way
    return 1.0 - slow / way * exp(-scope.rate * (time - fast))


@compiled
def expected_loss(
    scope: Any,
    p: Vector,
    place: Vector,
    horizon: float,
    shafts: np.ndarray,
    later: np.ndarray,
    organs: Organs,
    most: float,
) -> float:
    """How long a tip is lost till the horizon if the camera goes to a place, s.

    The mean over when all tools stop: at once, after each part of the time, or never.

    Args:
        scope: The endoscope's parameters.
        p: Where its tip is, m.
        place: Where it goes, m.
        horizon: When tools are at `later`, s.
        shafts: Tools, rows of fulcrum and tip (n, 6), R first, then S, m.
        later: The same at the horizon.
        organs: The organs.
        most: More is of no interest, s.
    """
    away = sub(place, p)
    way = norm(away)
    dt = horizon / PARTS
    total, limit = 0.0, most * (PARTS + 1.0) / dt
    for stop in range(PARTS, -1, -1):
        before = p
        was = shafts
        for j in range(1, PARTS + 1):
            share = share_at(scope, way, j * dt) if way > THERE else 0.0
            at = along(p, share, away)
            part = min(j, stop) / PARTS
            then = shafts + part * (later - shafts)
            view = seen_from(scope, at)
            seen = least_margin(view, then, then, organs, 2.0 * _BARELY) > _BARELY
            for i in range(2):
                tip = row_of(then[:, 3:], i)
                if seen and crossed(tip, i, before, at, was, then):
                    seen = False
            if not seen:
                total += 1.0
                if total > limit:
                    return 1e9
            before, was = at, then
    return total * dt / (PARTS + 1.0)


@compiled
def crossed(
    tip: Vector,
    own: int,
    before: Vector,
    after: Vector,
    shafts: np.ndarray,
    later: np.ndarray,
) -> bool:
    """Whether another tool gets through the ray to a tip, in one part of a way.

    Args:
        tip: The tip, m.
        own: Whose it is.
        before: The lens at first, m.
        after: The lens afterwards, m.
        shafts: Tools at first, rows of fulcrum and tip (n, 6), m.
        later: Tools afterwards.
    """
    for i in range(len(shafts)):
        g, b, c = row_of(shafts, i), row_of(shafts[:, 3:], i), row_of(later[:, 3:], i)
        if i == own:
            continue
        far = SPARED / max(norm(sub(b, g)), SPARED)
        b, c = along(b, far, sub(g, b)), along(c, far, sub(g, c))
        # The camera goes, then the tool: together they pass what both have passed.
        if segment_triangle_distance(g, b, tip, before, after) < SHAFT_RADIUS:
            return True
        if segment_triangle_distance(tip, after, g, b, c) < SHAFT_RADIUS:
            return True
    return False


@compiled
def way_clear(
    g: Vector,
    p: Vector,
    place: Vector,
    shafts: np.ndarray,
    later: np.ndarray,
    organs: Organs,
    room: float,
) -> bool:
    """Whether the endoscope keeps `room` from tools and organs at a place, m.

    And half of it on the way there, if it has that now.
    """
    half = along(p, 0.5, sub(place, p))
    tool = SCOPE + SHAFT_RADIUS
    for i in range(len(shafts)):
        a, b, c = row_of(shafts, i), row_of(shafts[:, 3:], i), row_of(later[:, 3:], i)
        if segment_triangle_distance(g, place, a, b, c) < tool + room:
            return False
        now = closest_points(g, p, a, b).distance - 1e-6
        passing = segment_triangle_distance(a, b, g, p, place)
        if passing < min(now, tool + 0.5 * room):
            return False
    for k in range(len(organs.table)):
        if shaft_distance(organs, k, g, place, 0.02)[0] < SCOPE + room:
            return False
        if shaft_distance(organs, k, g, half, 0.02)[0] < SCOPE + 0.5 * room:
            return False
    return True
