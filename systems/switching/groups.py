"""Going round standing obstacles that no body can pass between.

Two discs belong to one group if their safety circles overlap. The body keeps
the group on one side by following the involute-helicoid field of one member at
a time, and hands over to the member whose circle its way runs into. It leaves
when the free part of the ray to the goal ends nearer to the goal than the place
where it met the group (the rule of DistBug: I. Kamon, E. Rivlin, "Sensory-based
motion planning with global proofs", IEEE Trans. Robotics Autom. 13(6), 1997).
That distance falls from group to group, so that the walk ends.
"""

from collections.abc import Sequence
from math import atan2, inf, pi, sqrt

from systems.switching.arcs import TWO_PI, Disc, time_to_enter
from systems.switching.fields import involute_field

Follow = tuple[float, float, Disc, float]
"""Unit direction x, y of the way, the member it follows, its straight part [m]."""


def way_round(
    member: Disc,
    side: float,
    standing: Sequence[Disc],
    clearance: float,
    look_ahead: float,
    spare: float,
) -> Follow:
    """The direction that keeps a group on one side of the body.

    Args:
        member: Member of the group followed so far.
        side: +1 keeps the group on the left, -1 on the right.
        standing: All standing obstacles in sight.
        clearance: What a safety circle has beyond the disc's radius [m].
        look_ahead: Least length of the way that must be free of members [m].
        spare: Gaps between safety circles up to this width are closed [m].

    Returns:
        The direction, the member that it follows and the length of the way
        that is straight [m].
    """
    ex = ey = straight = 0.0
    for _ in range(len(standing) + 1):
        rho = member.radius + clearance
        qx, qy = member.q_x, member.q_y
        ex, ey = involute_field(qx, qy, rho, side)
        straight = sqrt(max(qx * qx + qy * qy - rho * rho, 0.0))
        reach = max(straight, look_ahead)
        following = None
        most = 1e-6
        for other in standing:
            touch = rho + other.radius + clearance + spare
            ax, ay = qx - other.q_x, qy - other.q_y
            if ax * ax + ay * ay >= touch * touch or other is member:
                continue
            if time_to_enter(ex, ey, (other,), clearance + spare) > reach:
                continue
            # Hand over to the member that turns the way most from the group.
            away, _, _ = _turn(ex, ey, other, clearance + spare, side)
            if away > most:
                most, following = away, other
        if following is None:
            break
        member = following
    return ex, ey, member, straight


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


def free_range(
    gx: float,
    gy: float,
    standing: Sequence[Disc],
    clearance: float,
    vision: float,
) -> float:
    """Free length of the ray from the body in unit direction g, as seen [m].

    Args:
        gx: Direction, x.
        gy: Direction, y.
        standing: Standing obstacles in sight.
        clearance: What a safety circle has beyond the disc's radius [m].
        vision: Radius of sight [m]; a disc whose centre is beyond is not seen.
    """
    largest = max((o.radius for o in standing), default=0.0)
    seen = max(vision - largest - clearance, 0.0)
    return min(time_to_enter(gx, gy, standing, clearance), seen)


def first_on_ray(
    gx: float,
    gy: float,
    standing: Sequence[Disc],
    clearance: float,
) -> Disc | None:
    """The standing obstacle whose safety circle a ray enters first."""
    first, found = inf, None
    for disc in standing:
        t = time_to_enter(gx, gy, (disc,), clearance)
        if t < first:
            first, found = t, disc
    return found


def shorter_side(
    gx: float,
    gy: float,
    member: Disc,
    standing: Sequence[Disc],
    clearance: float,
    look_ahead: float,
    spare: float,
    kept: float,
) -> float:
    """The side on which the way round a group turns least from the goal.

    Arguments as of `way_round`; the goal lies in unit direction g, and `kept` is
    the advantage [rad] of the counter-clockwise side.
    """

    def turn(side: float) -> float:
        ex, ey, _, _ = way_round(member, side, standing, clearance, look_ahead, spare)
        angle = atan2(-side * (gx * ey - gy * ex), gx * ex + gy * ey) % TWO_PI
        return angle if angle < 1.5 * pi else 0.0

    return 1.0 if turn(1.0) - turn(-1.0) <= kept else -1.0
