"""The headings at which a body of fixed speed meets moving discs.

In a disc's frame the body moves with u = v - w. It will enter the disc's
safety circle if u points into the cone of tangents to that circle, and the
edges of the cone are the involute-helicoid fields of the two sides. Carried
back to the world at the body's own speed v, each edge is one heading, and the
cone one arc of headings: all that is needed to choose the free heading
nearest to a wanted one, whatever the number of discs.
"""

from math import atan2, cos, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.signal import reader, row_writer, size
from systems.switching.fields import involute_components

TWO_PI = 2.0 * pi


class Disc(NamedTuple):
    """An obstacle relative to the body, which meets it with v - w."""

    track: float
    q_x: float  # the body's place less the centre's, m
    q_y: float
    radius: float  # m
    w_x: float  # its velocity, m/s
    w_y: float


class Arc(NamedTuple):
    """Headings that lead into a disc's safety circle.

    At the first (rightmost) heading the body passes the disc on its left, which
    is the counter-clockwise side, +1; at the last one on its right, -1.
    """

    first: float  # rad
    width: float  # counter-clockwise, rad
    track: float  # the disc's
    w_x: float
    w_y: float


class Choice(NamedTuple):
    """A free heading."""

    heading: float  # rad
    turn: float  # away from the wanted heading, rad; infinite if nothing is free
    track: float  # of the disc whose arc ends there; -1 if none's does
    side: float


DISC_SIZE, ARC_SIZE = size(Disc), size(Arc)
ARCS_OF_ONE = 4
"""A disc has no more arcs than its two edges are met at headings."""
read_disc, write_disc = reader(Disc), row_writer(Disc)
read_arc, write_arc = reader(Arc), row_writer(Arc)


@compiled
def time_to_enter(vx: float, vy: float, discs: np.ndarray, clearance: float) -> float:
    """Time until the body enters the safety circle of an obstacle [s].

    Args:
        vx: The body's velocity, x [m/s].
        vy: The same, y [m/s].
        discs: Rows of `Disc`, obstacles that keep their velocities.
        clearance: What a safety circle has beyond the disc's radius [m].

    Returns:
        The least time; zero within a circle if moving inwards; infinite if
        none is entered.
    """
    first = inf
    for i in range(len(discs)):
        disc = read_disc(discs[i])
        qx = disc.q_x
        qy = disc.q_y
        ux = vx - disc.w_x
        uy = vy - disc.w_y
        b = qx * ux + qy * uy
        if b >= 0.0:
            continue
        rho = disc.radius + clearance
        c = qx * qx + qy * qy - rho * rho
        if c <= 0.0:
            return 0.0
        a = ux * ux + uy * uy
        discriminant = b * b - a * c
        if discriminant > 0.0:
            first = min(first, (-b - sqrt(discriminant)) / a)
    return first


@compiled
def blocked_arcs(
    speed: float, discs: np.ndarray, clearance: float, horizon: float
) -> np.ndarray:
    """The arcs of headings that lead into the obstacles' safety circles.

    Args:
        speed: The body's [m/s], > 0.
        discs: Rows of `Disc`, obstacles that keep their velocities.
        clearance: What a safety circle has beyond the disc's radius [m].
        horizon: Discs that cannot be met within this time [s] have no arc.

    Returns:
        Rows of `Arc`.
    """
    arcs, count = np.empty((ARCS_OF_ONE * len(discs), ARC_SIZE)), 0
    vv = speed * speed
    for i in range(len(discs)):
        disc = read_disc(discs[i])
        qx, qy, wx, wy = disc.q_x, disc.q_y, disc.w_x, disc.w_y
        d = sqrt(qx * qx + qy * qy)
        nx, ny = qx / d, qy / d
        rho = disc.radius + clearance
        ww = wx * wx + wy * wy
        if ww > 0.98 * vv:
            count = _arcs_of_fast(arcs, count, disc, rho, speed, horizon)
            continue
        # Velocities w + s e of size v, for a relative heading e, here e = -n.
        k = wx * nx + wy * ny
        if d - rho > horizon * (k + sqrt(k * k + vv - ww)):
            continue
        along, out = involute_components(d, rho)
        if ww == 0.0 and d < rho:
            # A standing one only forbids to go deeper: between two of them both
            # ways along must stay free.
            along, out = 1.0, 0.0
        ox, oy, tx, ty = out * nx, out * ny, -along * ny, along * nx
        ex, ey = ox + tx, oy + ty
        k = ex * wx + ey * wy
        s = sqrt(k * k + vv - ww) - k
        first = atan2(wy + s * ey, wx + s * ex)
        ex, ey = ox - tx, oy - ty
        k = ex * wx + ey * wy
        s = sqrt(k * k + vv - ww) - k
        last = atan2(wy + s * ey, wx + s * ex)
        arc = Arc(first, (last - first) % TWO_PI, disc.track, wx, wy)
        write_arc(arcs, count, arc)
        count += 1
    return arcs[:count]


@compiled
def _arcs_of_fast(
    arcs: np.ndarray, count: int, disc: Disc, rho: float, speed: float, horizon: float
) -> int:
    """Adds those of an obstacle about as fast as the body, or faster; their number.

    Each edge of the cone may then be met at two headings or at none.
    """
    wx, wy = disc.w_x, disc.w_y
    d = sqrt(disc.q_x * disc.q_x + disc.q_y * disc.q_y)
    nx, ny = disc.q_x / d, disc.q_y / d
    ww = wx * wx + wy * wy
    if d - rho > horizon * (sqrt(ww) + speed):
        return count
    along, out = involute_components(d, rho)
    edges, found = np.zeros(ARCS_OF_ONE), 0
    for side in (1.0, -1.0):
        ex, ey = out * nx - side * along * ny, out * ny + side * along * nx
        k = ex * wx + ey * wy
        discriminant = k * k + speed * speed - ww
        # At equal speeds one root is u = 0: the heading of the obstacle itself
        # bounds the arc, so that roots at zero must not be lost to rounding.
        if discriminant > -1e-4 * ww:
            root = sqrt(discriminant) if discriminant > 0.0 else 0.0
            for s in (-k - root, -k + root):
                if s > -0.01 * speed:
                    edge, i = atan2(wy + s * ey, wx + s * ex), found
                    while i > 0 and edges[i - 1] > edge:
                        edges[i] = edges[i - 1]
                        i -= 1
                    edges[i] = edge
                    found += 1
    if found == 0:
        found = 1  # all headings are blocked, or none
    before = edges[found - 1] - TWO_PI
    for edge in edges[:found]:
        width = edge - before
        if width > 1e-9:
            middle = before + 0.5 * width
            ux = speed * cos(middle) - wx
            uy = speed * sin(middle) - wy
            if ux * nx + uy * ny < out * sqrt(ux * ux + uy * uy):
                write_arc(arcs, count, Arc(before, width, disc.track, wx, wy))
                count += 1
        before = edge
    return count


@compiled
def nearest_free(
    arcs: np.ndarray,
    wanted: float,
    speed: float,
    behind_bias: float,
    hysteresis: float,
    track: float,
    side: float,
    commitment: float,
    last: float,
) -> Choice:
    """The heading in no arc that is nearest to the wanted one.

    It is either the wanted heading or the end of an arc. The two candidates,
    to the right and to the left, are compared by their turn, less
    `behind_bias` times the part of w across the wanted heading towards which
    the body does not pass, over the speed: behind a crosser rather than before
    it; and less `hysteresis` for the obstacle and side of the last choice.

    Args:
        arcs: Rows of `Arc`, blocked.
        wanted: Heading [rad].
        speed: The body's speed [m/s].
        behind_bias: [rad].
        hysteresis: [rad].
        track: Obstacle of the last choice.
        side: Side of the last choice.
        commitment: Cost of turning away from the last heading [rad per rad].
        last: Heading of the last choice [rad].

    Returns:
        The choice; of an infinite turn if every heading is blocked.
    """
    best, chosen = inf, Choice(wanted, inf, -1.0, 1.0)
    for sign in (1.0, -1.0):
        heading, turn, edge = wanted, 0.0, -1
        moved = True
        while moved and turn < TWO_PI:
            moved = False
            for i in range(len(arcs)):
                arc = read_arc(arcs[i])
                if sign > 0.0:  # how far to the right its first heading lies
                    step = (heading - arc.first) % TWO_PI
                else:
                    step = (arc.first + arc.width - heading) % TWO_PI
                if 1e-9 < step < arc.width - 1e-9 or step < arc.width >= TWO_PI:
                    heading -= sign * step
                    turn += step
                    edge = i
                    moved = True
                    if arc.width >= TWO_PI:
                        turn = TWO_PI
        if turn >= TWO_PI - 1e-6:
            continue
        cost, whose = turn, -1.0
        if edge >= 0:
            arc = read_arc(arcs[edge])
            across = arc.w_y * cos(wanted) - arc.w_x * sin(wanted)
            cost -= behind_bias * sign * across / speed
            if arc.track == track and sign == side:
                cost -= hysteresis
            cost += commitment * abs((heading - last + pi) % TWO_PI - pi)
            whose = max(arc.track, -1.0)
        if cost < best:
            best, chosen = cost, Choice(heading, turn, whose, sign)
    return chosen
