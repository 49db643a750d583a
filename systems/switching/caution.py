"""Caution: slower before those who are not seen, and who may turn.

Both limits follow from what a body needs to stand or to back away: its reaction, its
deceleration, and how fast the other may come.
"""

from math import hypot, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled
from systems.common.signal import reader
from systems.switching.arcs import Disc, read_disc, time_to_enter
from systems.switching.signals import Corner
from systems.switching.switching_state import Sight

read_corner = reader(Corner)


@compiled
def cautious(
    params: Any, sight: Sight, corners: np.ndarray, vx: float, vy: float
) -> tuple[float, float]:
    """Slower for who may step out or turn, unless somebody seen is met by it.

    Args:
        params: A record of `constants`.
        sight: What is seen.
        corners: Rows of `Corner`.
        vx: The velocity that is wanted, x [m/s].
        vy: The same, y [m/s].
    """
    speed = hypot(vx, vy)
    if speed < 1e-9:
        return vx, vy
    ex, ey = vx / speed, vy / speed
    limit = speed
    if params.unseen_speed > 0.0:
        for i in range(len(corners)):
            corner = read_corner(corners[i])
            if corner.there > 0.0:
                limit = _before_corner(params, sight, corner, ex, ey, limit)
    moving, whose = sight.moving, -1
    for i in range(len(moving)):
        slower = _before_turning(params, sight, read_disc(moving[i]), ex, ey, limit)
        if slower < limit:
            limit, whose = slower, i
    if limit < speed:
        meets = _meets_others(params, moving, whose, limit * ex, limit * ey)
        soon = min(params.horizon, _meets_others(params, moving, whose, vx, vy))
        if meets < soon:
            limit = speed
    return (limit * ex, limit * ey) if limit < speed else (vx, vy)


@compiled
def _meets_others(
    params: Any, moving: np.ndarray, whose: int, vx: float, vy: float
) -> float:
    """Time [s] until somebody who moves is met, but for the one of row `whose`."""
    clearance = params.body_radius + params.least
    if whose < 0:
        return time_to_enter(vx, vy, moving, clearance)
    before = time_to_enter(vx, vy, moving[:whose], clearance)
    return min(before, time_to_enter(vx, vy, moving[whose + 1 :], clearance))


@compiled
def _before_corner(
    params: Any,
    sight: Sight,
    corner: Corner,
    ex: float,
    ey: float,
    limit: float,
) -> float:
    """The speed at which the body stands before who steps out can reach it.

    Who walks at `unseen_speed` w from the edge the moment it is passed is seen, and
    after the time `reaction` T the body brakes with `braking` a: while it does, for
    T + v/a, its way may come no nearer to the edge than w (T + v/a). A body that
    stands is not in the way of anybody who looks where they go: no corner is passed
    slower than it can stop within the least of its margins.
    """
    a, w, t_r = params.braking, params.unseen_speed, params.reaction
    qx, qy = corner.x - sight.px, corner.y - sight.py
    along, across = qx * ex + qy * ey, qx * ey - qy * ex
    if along <= 0.0:
        return limit
    low, high = 0.0, limit
    for _ in range(6):  # the free distance falls with the speed: by halves
        v = high if high == limit and low == 0.0 else 0.5 * (low + high)
        stop = v * t_r + 0.5 * v * v / a
        gap = hypot(max(along - stop, 0.0), across) - params.body_radius
        if gap >= w * (t_r + v / a):
            low = v
            if v == limit:
                break
        else:
            high = v
    least = a * (sqrt(t_r * t_r + 2.0 * params.least / a) - t_r)
    return min(max(low, least), limit)


@compiled
def _before_turning(
    params: Any,
    sight: Sight,
    disc: Disc,
    ex: float,
    ey: float,
    limit: float,
) -> float:
    """The speed at which the body can still back away from who turns towards it.

    Who walks at something that stands turns before it, and nobody knows where to. If
    he does so towards the body, then after `notice` and `reaction` T it backs away with
    `braking` a: the two have come nearer by s T + s^2 / (2 a), s being the speed at
    which they were nearing.
    """
    qx, qy, wx, wy = disc.q_x, disc.q_y, disc.w_x, disc.w_y
    d = max(hypot(qx, qy), 1e-9)
    share = -(qx * ex + qy * ey) / d  # of the body's speed, towards him
    if share <= 0.0:
        return limit
    a, w, t_r = params.braking, hypot(wx, wy), params.notice + params.reaction
    gap = max(d - disc.radius - params.body_radius, 0.0)
    s = a * (sqrt(t_r * t_r + 2.0 * gap / a) - t_r)
    most = max(s - w, 0.0) / share
    if most >= limit:
        return limit
    for i in range(len(sight.standing)):
        o = read_disc(sight.standing[i])
        ax, ay = o.q_x - qx, o.q_y - qy  # his place less the other's
        b = ax * wx + ay * wy
        rho = o.radius + disc.radius
        c = ax * ax + ay * ay - rho * rho
        if b < 0.0 and b * b > w * w * c:
            return most
    return limit
