"""A tool's fulcrum, found from the lines of its shaft, and what it gives in return.

A frame of the tracker gives a line; the fulcrum lies on it but for noise, and nothing
is said about where along it. Lines in different directions together say where. A
Kalman filter with the fulcrum as its state is the recursive least-squares
intersection of the lines; a slow random walk lets it forget, since fulcrums move.

In return: the markers' mean is found some eight times better than the direction of the
shaft, and the shaft runs from the markers' mean through the fulcrum. That is a second
direction; both are fused, each weighted by its variance, and so the tip is known
several times better than it is measured.
"""

import math

from systems.auto_guidance.optical_tracker import MarkerBody
from systems.common.geometry import any_perpendicular, cross

Point = tuple[float, float, float]
PointCovariance = tuple[float, float, float, float, float, float]
"""Of a point in W: (xx, xy, xz, yy, yz, zz) in m^2."""

_QUIET = 4e-3  # rad, that the shaft may turn before its reference direction follows
_NEAREST = 0.05  # m, from the markers' mean: a nearer fulcrum gives no direction


def lateral_variance(P: PointCovariance, u: Point) -> float:
    """Mean variance of a point across the direction u (unit vector), in m^2."""
    xx, xy, xz, yy, yz, zz = P
    ux, uy, uz = u
    along = ux * (ux * xx + 2.0 * (uy * xy + uz * xz))
    along += uy * (uy * yy + 2.0 * uz * yz) + uz * uz * zz
    return max(0.5 * (xx + yy + zz - along), 0.0)


def measure(
    p: Point, P: PointCovariance, h: Point, value: float, variance: float
) -> tuple[Point, PointCovariance]:
    """Takes in that h . p = value, with the given variance.

    Args:
        p: The point's estimate in m.
        P: Its covariance.
        h: A unit vector.
        value: Measured h . p in m.
        variance: Of the measurement in m^2, > 0.

    Returns:
        The new estimate and its covariance.
    """
    x, y, z = p
    xx, xy, xz, yy, yz, zz = P
    hx, hy, hz = h
    ax = xx * hx + xy * hy + xz * hz
    ay = xy * hx + yy * hy + yz * hz
    az = xz * hx + yz * hy + zz * hz
    s = hx * ax + hy * ay + hz * az + variance
    kx, ky, kz = ax / s, ay / s, az / s
    innovation = value - hx * x - hy * y - hz * z
    return (
        (x + kx * innovation, y + ky * innovation, z + kz * innovation),
        (
            xx - kx * ax,
            xy - kx * ay,
            xz - kx * az,
            yy - ky * ay,
            yz - ky * az,
            zz - kz * az,
        ),
    )


def measure_line(
    p: Point,
    P: PointCovariance,
    c: Point,
    u: Point,
    reference: Point,
    variance: float,
) -> tuple[Point, PointCovariance]:
    """Takes in a line that passes the point, but for noise across the line.

    The line speaks across `reference` only, a quiet direction within some mrad of its
    own. Were the noisy direction itself used, each frame would point elsewhere, and a
    tool at rest would seem to say where along its shaft the fulcrum lies: the
    lines of many frames meet where their noise turns about, at the markers.

    Args:
        p: The point's estimate in m.
        P: Its covariance.
        c: A point of the line in m.
        u: The line's direction, a unit vector.
        reference: The direction that is taken for the line's, a unit vector.
        variance: Of the line along each direction across it, at the point, in m^2.

    Returns:
        The new estimate and its covariance.
    """
    cx, cy, cz = c
    ux, uy, uz = u
    rx, ry, rz = reference
    # Where the line pierces the plane through the estimate, across the reference.
    t = (p[0] - cx) * rx + (p[1] - cy) * ry + (p[2] - cz) * rz
    t /= ux * rx + uy * ry + uz * rz
    cx, cy, cz = cx + t * ux, cy + t * uy, cz + t * uz
    e = any_perpendicular(reference)
    f = cross(reference, e)
    q, Q = measure(p, P, e, e[0] * cx + e[1] * cy + e[2] * cz, variance)
    return measure(q, Q, f, f[0] * cx + f[1] * cy + f[2] * cz, variance)


class ShaftFulcrum:
    """Finds a tool's fulcrum, and the tip by its help; all that changes is the state.

    State (12): fulcrum p_WG in m (3), its covariance (6), and the shaft's reference
    direction (3, see `measure_line`).

    Args:
        body: The markers on the tool.
        given: p_WG in m if it is known, or None to estimate it.
        wall: Height of the abdominal wall in W, and its standard deviation, in m.
        depth: Of the tip below the fulcrum when it is first seen, and its standard
            deviation, in m.
        drift: How fast the fulcrum may wander along each axis, in m/sqrt(s).
        gate: A line that passes the fulcrum at more than so many standard deviations
            belongs to another fulcrum.
    """

    def __init__(
        self,
        body: MarkerBody,
        given: list[float] | None,
        wall: tuple[float, float],
        depth: tuple[float, float],
        drift: float,
        gate: float,
    ) -> None:
        # A micrometre at least: the covariance stays regular without noise.
        self.lever = body.lever
        self.var_c = max(body.sigma_position(), 1e-6) ** 2
        self.var_u = max(body.sigma_direction(), 1e-6) ** 2
        self.var_tip = self.var_c + self.lever * self.lever * self.var_u
        self._given = given
        self._wall, self._depth = wall, depth
        self._drift2 = drift * drift
        self._gate2 = gate * gate

    def initial(self) -> list[float]:
        """The state before the first frame."""
        return [*(self._given or [0.0] * 3), *[0.0] * 8, -1.0]

    def absorb(
        self, x: list[float], c: Point, u: Point, dt: float | None
    ) -> tuple[list[float], Point, float, float]:
        """Fuses the shaft's direction with the fulcrum's, and refines the fulcrum.

        Args:
            x: State (12).
            c: Measured mean of the markers in m.
            u: Measured direction of the shaft, a unit vector.
            dt: Time since the frame before in s, or None at the first frame.

        Returns:
            The state after the frame; the fused tip in m; the variance along each
            axis in m^2 of its noise, and of the error it takes over from the
            fulcrum: that one is slow, so that no filtering reduces it.
        """
        cx, cy, cz = c
        ux, uy, uz = u
        g: Point = (x[0], x[1], x[2])
        P: PointCovariance = (x[3], x[4], x[5], x[6], x[7], x[8])
        r: Point = (x[9], x[10], x[11])
        first = self._given is None and dt is None
        if first:
            (g, P), r = self._beforehand(c, u), u
        elif self._given is None and dt is not None:
            q = self._drift2 * dt
            P = (P[0] + q, P[1], P[2], P[3] + q, P[4], P[5] + q)
        dx, dy, dz = g[0] - cx, g[1] - cy, g[2] - cz
        d2 = dx * dx + dy * dy + dz * dz
        along = dx * ux + dy * uy + dz * uz
        var_g = lateral_variance(P, u)
        var_line = self.var_c + d2 * self.var_u
        wx, wy, wz = u
        variance, shared = self.var_tip, 0.0
        if d2 - along * along > self._gate2 * (var_line + var_g):
            if self._given is None:  # another fulcrum: begin again
                (g, P), r = self._beforehand(c, u), u
        elif along > _NEAREST and not first:
            distance = math.sqrt(d2)
            dx, dy, dz = dx / distance, dy / distance, dz / distance
            weight = d2 * self.var_u / (var_line + var_g)
            rest = 1.0 - weight
            wx = rest * ux + weight * dx
            wy = rest * uy + weight * dy
            wz = rest * uz + weight * dz
            ratio = weight * self.lever / distance
            variance = (1.0 - ratio) ** 2 * self.var_c
            variance += (rest * self.lever) ** 2 * self.var_u
            variance = max(variance, self.var_c)  # along the shaft
            shared = ratio * ratio * var_g
            if dx * r[0] + dy * r[1] + dz * r[2] < 1.0 - 0.5 * _QUIET * _QUIET:
                r = (dx, dy, dz)
        if self._given is None:
            g, P = measure_line(g, P, c, u, r, var_line)
        k = self.lever / math.sqrt(wx * wx + wy * wy + wz * wz)
        tip = (cx + k * wx, cy + k * wy, cz + k * wz)
        return [*g, *P, *r], tip, variance, shared

    def _beforehand(self, c: Point, u: Point) -> tuple[Point, PointCovariance]:
        """The fulcrum that is expected of a shaft when nothing else is known."""
        height, sigma_wall = self._wall
        depth, sigma_depth = self._depth
        up = self.lever - depth
        g = (c[0] + up * u[0], c[1] + up * u[1], c[2] + up * u[2])
        var = sigma_depth**2
        P = (var, 0.0, 0.0, var, 0.0, var)
        return measure(g, P, (0.0, 0.0, 1.0), height, sigma_wall**2)
