"""Sight: whether the endoscope sees a tip, and by how much.

A tip's margin is an angle at the lens: to the border of the picture, or to what comes
nearest to the ray from the lens to the tip, a shaft or an organ. It is seen where the
margin is positive. The last part of every shaft is left out: tools meet there.
"""

from typing import Annotated, NamedTuple

import numpy as np

from plants.organs.distance import Organs, distance
from systems.bypass.tip_edge import arccos
from systems.common.compiled import compiled
from systems.common.geometry import (
    along,
    closest_points,
    dot,
    norm,
    over,
    row_of,
    segment_triangle_distance,
    sub,
)
from systems.common.signal import Field, Vector
from systems.common.signals import ViewCone

SPARED = 0.015
"""Of a shaft at its tip, m."""
SHAFT_RADIUS = 0.0025
_BEFORE_LENS = 0.01
_BEFORE_TIP = 0.008
"""What is nearer to the lens, or to the tip, does not count, m."""
_STEP = 0.002
_STILL = 1e-4
"""A tool that goes less far stands, m."""


class Sight(NamedTuple):
    """What the camera sees, and what it does."""

    robot: Annotated[float, Field("rad", "margin of R's tip; negative: unseen", 0.2)]
    target: Annotated[float, Field("rad", "margin of S's tip", 0.2)]
    moves: Annotated[float, Field("1", "1 while it moves to a better place", 0.0)]


@compiled
def cone_margin(view: ViewCone, p: Vector) -> float:
    """Angle of a point from the border of the picture, rad; negative outside."""
    ray = sub(p, view.apex)
    length = norm(ray)
    return view.half - arccos(dot(over(ray, max(length, 1e-9)), view.u))


@compiled
def shaft_margin(view: ViewCone, p: Vector, a: Vector, b: Vector) -> float:
    """Angle at the lens between the ray to p and a shaft from a to b, rad."""
    ray = sub(p, view.apex)
    length = norm(ray)
    first, last = _BEFORE_LENS / length, 1.0 - _BEFORE_TIP / length
    if last <= first:
        return 1.0
    near = closest_points(
        along(view.apex, first, ray), along(view.apex, last, ray), a, b
    )
    return (near.distance - SHAFT_RADIUS) / norm(sub(near.p_A, view.apex))


@compiled
def organ_margin(view: ViewCone, p: Vector, organs: Organs, enough: float) -> float:
    """Least angle at the lens between the ray to p and an organ, rad, or `enough`."""
    ray = sub(p, view.apex)
    length, margin, t = norm(ray), enough, _BEFORE_LENS
    while t < length - _BEFORE_TIP:
        q = along(view.apex, t / length, ray)
        room = 1e9
        for k in range(len(organs.table)):
            room = min(room, distance(organs, k, q))
        margin = min(margin, room / t)
        if room < 0.0:
            return margin
        t += max(_STEP, room - enough * t)
    return margin


@compiled
def swept_margin(
    view: ViewCone,
    own: int,
    tips: np.ndarray,
    shafts: np.ndarray,
    later: np.ndarray,
    organs: Organs,
    enough: float,
) -> float:
    """Margin of a tip wherever the other tools go from `shafts` to `later`, rad.

    A shaft sweeps a triangle under its fulcrum. Where the ray goes through that, the
    tip is hidden for a while, wherever the shaft is now.

    Args:
        view: What the camera sees.
        own: Whose tip it is: a row of the tools.
        tips: Where that tool is (n, 6), m; its own way does not count.
        shafts: All tools, rows of fulcrum and tip (n, 6), m.
        later: The same afterwards.
        organs: The organs.
        enough: More is of no interest, rad.
    """
    p = row_of(tips[:, 3:], own)
    margin = min(enough, cone_margin(view, p))
    for i in range(len(shafts)):
        if margin < 0.0:
            return margin
        g = row_of(shafts, i)
        if i == own:
            b = c = _spared(g, p)
        else:
            b = _spared(g, row_of(shafts[:, 3:], i))
            c = _spared(g, row_of(later[:, 3:], i))
        near = shaft_margin(view, p, g, b)
        if norm(sub(c, b)) > _STILL:
            near = min(near, shaft_margin(view, p, g, c), shaft_margin(view, p, b, c))
            if segment_triangle_distance(view.apex, p, g, b, c) <= 0.0:
                near = -abs(near)
        margin = min(margin, near)
    if margin < 0.0:
        return margin
    return min(margin, organ_margin(view, p, organs, enough))


@compiled
def _spared(g: Vector, p: Vector) -> Vector:
    """Where the part of a shaft ends that counts; its fulcrum if nothing does."""
    d = sub(p, g)
    return along(g, 1.0 - SPARED / max(norm(d), SPARED), d)


@compiled
def tip_margin(
    view: ViewCone, p: Vector, shafts: np.ndarray, organs: Organs, enough: float
) -> float:
    """Margin of a tip, rad, up to `enough`.

    Args:
        view: What the camera sees.
        p: The tip, m.
        shafts: All tools, rows of fulcrum and tip (n, 6), m.
        organs: The organs.
        enough: More is of no interest, rad.
    """
    margin = min(enough, cone_margin(view, p))
    for i in range(len(shafts)):
        if margin < 0.0:
            return margin
        a, b = row_of(shafts[:, :3], i), row_of(shafts[:, 3:], i)
        d = sub(b, a)
        length = norm(d)
        if length <= SPARED:
            continue
        end = along(a, 1.0 - SPARED / length, d)
        margin = min(margin, shaft_margin(view, p, a, end))
    if margin < 0.0:
        return margin
    return min(margin, organ_margin(view, p, organs, enough))
