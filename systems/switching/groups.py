"""Going round standing obstacles that no body can pass between.

Two discs belong to one group if their safety circles overlap. The body keeps
the group on one side by following the involute-helicoid field of one member at
a time, and hands over to the member whose circle its way runs into. It leaves
when the free part of the ray to the goal ends nearer to the goal than the place
where it met the group (the rule of DistBug: I. Kamon, E. Rivlin, "Sensory-based
motion planning with global proofs", IEEE Trans. Robotics Autom. 13(6), 1997).
That distance falls from group to group, so that the walk ends.
"""

from math import atan2, inf, pi, sqrt

import numpy as np

from systems.common.compiled import compiled
from systems.switching.arcs import TWO_PI, Disc, read_disc, time_to_enter
from systems.switching.fields import involute_field

Follow = tuple[float, float, int, float]
"""Unit direction x, y of the way, the member it follows, its straight part [m]."""


@compiled
def way_round(
    member: int,
    side: float,
    standing: np.ndarray,
    clearance: float,
    look_ahead: float,
    spare: float,
) -> Follow:
    """The direction that keeps a group on one side of the body.

    Args:
        member: The row of the group's member followed so far.
        side: +1 keeps the group on the left, -1 on the right.
        standing: Rows of `Disc`, all standing obstacles in sight.
        clearance: What a safety circle has beyond the disc's radius [m].
        look_ahead: Least length of the way that must be free of members [m].
        spare: Gaps between safety circles up to this width are closed [m].

    Returns:
        The direction, the member that it follows and the length of the way
        that is straight [m].
    """
    ex = ey = straight = 0.0
    for _ in range(len(standing) + 1):
        followed = read_disc(standing[member])
        rho = followed.radius + clearance
        qx, qy = followed.q_x, followed.q_y
        ex, ey = involute_field(qx, qy, rho, side)
        straight = sqrt(max(qx * qx + qy * qy - rho * rho, 0.0))
        reach = max(straight, look_ahead)
        following, most = -1, 1e-6
        for i in range(len(standing)):
            other = read_disc(standing[i])
            touch = rho + other.radius + clearance + spare
            ax, ay = qx - other.q_x, qy - other.q_y
            if ax * ax + ay * ay >= touch * touch or i == member:
                continue
            if time_to_enter(ex, ey, standing[i : i + 1], clearance + spare) > reach:
                continue
            # Hand over to the member that turns the way most from the group.
            away, _, _ = _turn(ex, ey, other, clearance + spare, side)
            if away > most:
                most, following = away, i
        if following < 0:
            break
        member = following
    return ex, ey, member, straight


@compiled
def _turn(
    ex: float,
    ey: float,
    other: Disc,
    clearance: float,
    side: float,
) -> tuple[float, float, float]:
    """How far [rad] the way past another disc turns from the way e, and that way."""
    rho = other.radius + clearance
    fx, fy = involute_field(other.q_x, other.q_y, rho, side)
    away = atan2(-side * (ex * fy - ey * fx), ex * fx + ey * fy) % TWO_PI
    return (away if away < 1.5 * pi else 0.0), fx, fy


@compiled
def free_range(
    gx: float,
    gy: float,
    standing: np.ndarray,
    clearance: float,
    vision: float,
) -> float:
    """Free length of the ray from the body in unit direction g, as seen [m].

    Args:
        gx: Direction, x.
        gy: Direction, y.
        standing: Rows of `Disc`, standing obstacles in sight.
        clearance: What a safety circle has beyond the disc's radius [m].
        vision: Radius of sight [m]; a disc whose centre is beyond is not seen.
    """
    largest = 0.0
    for i in range(len(standing)):
        largest = max(largest, read_disc(standing[i]).radius)
    seen = max(vision - largest - clearance, 0.0)
    return min(time_to_enter(gx, gy, standing, clearance), seen)


@compiled
def first_on_ray(
    gx: float,
    gy: float,
    standing: np.ndarray,
    clearance: float,
) -> int:
    """The row of the obstacle whose safety circle a ray enters first; -1 for none."""
    first, found = inf, -1
    for i in range(len(standing)):
        t = time_to_enter(gx, gy, standing[i : i + 1], clearance)
        if t < first:
            first, found = t, i
    return found


@compiled
def _turn_round(
    gx: float,
    gy: float,
    member: int,
    side: float,
    standing: np.ndarray,
    clearance: float,
    look_ahead: float,
    spare: float,
) -> float:
    """How far [rad] the way round a group turns from the goal on one side."""
    ex, ey, _, _ = way_round(member, side, standing, clearance, look_ahead, spare)
    angle = atan2(-side * (gx * ey - gy * ex), gx * ex + gy * ey) % TWO_PI
    return angle if angle < 1.5 * pi else 0.0


@compiled
def shorter_side(
    gx: float,
    gy: float,
    member: int,
    standing: np.ndarray,
    clearance: float,
    look_ahead: float,
    spare: float,
    kept: float,
) -> float:
    """The side on which the way round a group turns least from the goal.

    Arguments as of `way_round`; the goal lies in unit direction g, and `kept` is
    the advantage [rad] of the counter-clockwise side.
    """
    rest = standing, clearance, look_ahead, spare
    left = _turn_round(gx, gy, member, 1.0, *rest)
    right = _turn_round(gx, gy, member, -1.0, *rest)
    return 1.0 if left - right <= kept else -1.0
