"""The headings at which a body of fixed speed meets moving discs.

In a disc's frame the body moves with u = v - w. It will enter the disc's
safety circle if u points into the cone of tangents to that circle, and the
edges of the cone are the involute-helicoid fields of the two sides. Carried
back to the world at the body's own speed v, each edge is one heading, and the
cone one arc of headings: all that is needed to choose the free heading
nearest to a wanted one, whatever the number of discs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, inf, pi, sin, sqrt
from typing import NamedTuple

from systems.switching.fields import involute_components

TWO_PI = 2.0 * pi


@dataclass(slots=True)
class Disc:
    """An obstacle relative to the body, which meets it with v - w.

    Not a tuple: a step reads fields hundreds of times, and a slot is read at once.
    """

    track: float
    q_x: float  # the body's place less the centre's, m
    q_y: float
    radius: float  # m
    w_x: float  # its velocity, m/s
    w_y: float


Arc = tuple[float, float, Disc]
"""First heading [rad], width [rad] counter-clockwise, and whose arc it is.

At the first (rightmost) heading the body passes the disc on its left, which
is the counter-clockwise side, +1; at the last one on its right, -1.
"""


class Choice(NamedTuple):
    """A free heading."""

    heading: float  # rad
    turn: float  # away from the wanted heading, rad
    disc: Disc | None  # whose arc ends there
    side: float


def time_to_enter(
    vx: float, vy: float, discs: Sequence[Disc], clearance: float
) -> float:
    """Time until the body enters the safety circle of an obstacle [s].

    Args:
        vx: The body's velocity, x [m/s].
        vy: The same, y [m/s].
        discs: The obstacles, which keep their velocities.
        clearance: What a safety circle has beyond the disc's radius [m].

    Returns:
        The least time; zero within a circle if moving inwards; infinite if
        none is entered.
    """
    first = inf
    for disc in discs:
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
            t = (-b - sqrt(discriminant)) / a
            if t < first:
                first = t
    return first


def blocked_arcs(
    speed: float, discs: Sequence[Disc], clearance: float, horizon: float
) -> list[Arc]:
    """The arcs of headings that lead into the obstacles' safety circles.

    Args:
        speed: The body's [m/s], > 0.
        discs: The obstacles, which keep their velocities.
        clearance: What a safety circle has beyond the disc's radius [m].
        horizon: Discs that cannot be met within this time [s] have no arc.
    """
    arcs: list[Arc] = []
    vv = speed * speed
    for disc in discs:
        qx = disc.q_x
        qy = disc.q_y
        wx = disc.w_x
        wy = disc.w_y
        d = sqrt(qx * qx + qy * qy)
        nx = qx / d
        ny = qy / d
        rho = disc.radius + clearance
        ww = wx * wx + wy * wy
        if ww > 0.98 * vv:
            arcs.extend(_arcs_of_fast(disc, d, nx, ny, rho, speed, horizon))
            continue
        # Velocities w + s e of size v, for a relative heading e, here e = -n.
        k = wx * nx + wy * ny
        if d - rho > horizon * (k + sqrt(k * k + vv - ww)):
            continue
        if ww == 0.0 and d < rho:
            # A standing one only forbids to go deeper: between two of them both
            # ways along must stay free.
            along, out = 1.0, 0.0
        elif d >= rho:  # as involute_components, without the call
            along = rho / d
            out = -sqrt(1.0 - along * along)
        else:
            along, out = involute_components(d, rho)
        ox = out * nx
        oy = out * ny
        tx = -along * ny
        ty = along * nx
        ex = ox + tx
        ey = oy + ty
        k = ex * wx + ey * wy
        s = sqrt(k * k + vv - ww) - k
        first = atan2(wy + s * ey, wx + s * ex)
        ex = ox - tx
        ey = oy - ty
        k = ex * wx + ey * wy
        s = sqrt(k * k + vv - ww) - k
        last = atan2(wy + s * ey, wx + s * ex)
        arcs.append((first, (last - first) % TWO_PI, disc))
    return arcs


def _arcs_of_fast(
    disc: Disc,
    d: float,
    nx: float,
    ny: float,
    rho: float,
    speed: float,
    horizon: float,
) -> list[Arc]:
    """The arcs of an obstacle about as fast as the body, or faster.

    Each edge of the cone may then be met at two headings or at none.
    """
    wx, wy = disc.w_x, disc.w_y
    ww = wx * wx + wy * wy
    if d - rho > horizon * (sqrt(ww) + speed):
        return []
    along, out = involute_components(d, rho)
    edges: list[float] = []
    for ex, ey in (
        (out * nx - along * ny, out * ny + along * nx),
        (out * nx + along * ny, out * ny - along * nx),
    ):
        k = ex * wx + ey * wy
        discriminant = k * k + speed * speed - ww
        # At equal speeds one root is u = 0: the heading of the obstacle itself
        # bounds the arc, so that roots at zero must not be lost to rounding.
        if discriminant > -1e-4 * ww:
            root = sqrt(discriminant) if discriminant > 0.0 else 0.0
            least = -0.01 * speed
            if -k - root > least:
                s = -k - root
                edges.append(atan2(wy + s * ey, wx + s * ex))
            if -k + root > least:
                s = -k + root
                edges.append(atan2(wy + s * ey, wx + s * ex))
    edges.sort()
    if not edges:
        edges = [0.0]  # all headings are blocked, or none
    arcs: list[Arc] = []
    before = edges[-1] - TWO_PI
    for edge in edges:
        width = edge - before
        if width > 1e-9:
            middle = before + 0.5 * width
            ux = speed * cos(middle) - wx
            uy = speed * sin(middle) - wy
            if ux * nx + uy * ny < out * sqrt(ux * ux + uy * uy):
                arcs.append((before, width, disc))
        before = edge
    return arcs


def nearest_free(
    arcs: Sequence[Arc],
    wanted: float,
    speed: float,
    behind_bias: float,
    hysteresis: float,
    track: float,
    side: float,
    commitment: float = 0.0,
    last: float = 0.0,
) -> Choice | None:
    """The heading in no arc that is nearest to the wanted one.

    It is either the wanted heading or the end of an arc. The two candidates,
    to the right and to the left, are compared by their turn, less
    `behind_bias` times the part of w across the wanted heading towards which
    the body does not pass, over the speed: behind a crosser rather than before
    it; and less `hysteresis` for the obstacle and side of the last choice.

    Args:
        arcs: Blocked arcs.
        wanted: Heading [rad].
        speed: The body's speed [m/s].
        behind_bias: [rad].
        hysteresis: [rad].
        track: Obstacle of the last choice.
        side: Side of the last choice.
        commitment: Cost of turning away from the last heading [rad per rad].
        last: Heading of the last choice [rad].

    Returns:
        The choice, or None if every heading is blocked.
    """
    best, chosen = inf, None
    for sign in (1.0, -1.0):
        heading = wanted
        turn = 0.0
        edge: Disc | None = None
        moved = True
        while moved and turn < TWO_PI:
            moved = False
            for first, width, disc in arcs:
                if sign > 0.0:  # how far to the right its first heading lies
                    step = (heading - first) % TWO_PI
                else:
                    step = (first + width - heading) % TWO_PI
                if 1e-9 < step < width - 1e-9 or step < width >= TWO_PI:
                    heading -= sign * step
                    turn += step
                    edge = disc
                    moved = True
                    if width >= TWO_PI:
                        turn = TWO_PI
        if turn >= TWO_PI - 1e-6:
            continue
        cost = turn
        if edge is not None:
            across = edge.w_y * cos(wanted) - edge.w_x * sin(wanted)
            cost -= behind_bias * sign * across / speed
            if edge.track == track and sign == side:
                cost -= hysteresis
            cost += commitment * abs((heading - last + pi) % TWO_PI - pi)
        if cost < best:
            best, chosen = cost, (heading, turn, edge, sign)
    return Choice(*chosen) if chosen else None
