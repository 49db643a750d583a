"""The fulcrum of a tool, found as the point that all lines of its shaft pass through.

A frame of the tracker gives a line; the fulcrum lies on it but for noise, and nothing
is said about where along it. Lines in different directions together say where. A
Kalman filter with the fulcrum as its state is the recursive least-squares
intersection of the lines; a slow random walk lets it forget, since fulcrums move.
"""

from collections.abc import Sequence
import math

PointCovariance = tuple[float, float, float, float, float, float]
"""Of a point in W: (xx, xy, xz, yy, yz, zz) in m^2."""


def across(ux: float, uy: float, uz: float) -> tuple[float, ...]:
    """Two unit vectors (6) that are perpendicular to the unit vector u."""
    if abs(ux) < 0.7:  # e = u x X
        n = math.sqrt(uy * uy + uz * uz)
        ex, ey, ez = 0.0, uz / n, -uy / n
    else:  # e = u x Z
        n = math.sqrt(ux * ux + uy * uy)
        ex, ey, ez = uy / n, -ux / n, 0.0
    fx, fy, fz = uy * ez - uz * ey, uz * ex - ux * ez, ux * ey - uy * ex
    return ex, ey, ez, fx, fy, fz


def lateral_variance(P: PointCovariance, u: Sequence[float]) -> float:
    """Mean variance of a point across the direction u (unit vector), in m^2."""
    xx, xy, xz, yy, yz, zz = P
    ux, uy, uz = u
    along = ux * (ux * xx + 2.0 * (uy * xy + uz * xz))
    along += uy * (uy * yy + 2.0 * uz * yz) + uz * uz * zz
    return max(0.5 * (xx + yy + zz - along), 0.0)


def measure(
    p: Sequence[float],
    P: PointCovariance,
    h: Sequence[float],
    value: float,
    variance: float,
) -> tuple[tuple[float, float, float], PointCovariance]:
    """Takes in that h . p = value, with the given variance.

    Args:
        p: The point's estimate in m (3).
        P: Its covariance.
        h: A unit vector (3).
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
    p: Sequence[float],
    P: PointCovariance,
    c: Sequence[float],
    u: Sequence[float],
    variance: float,
) -> tuple[tuple[float, float, float], PointCovariance]:
    """Takes in a line that passes the point, but for noise across the line.

    Args:
        p: The point's estimate in m (3).
        P: Its covariance.
        c: A point of the line in m (3).
        u: The line's direction, a unit vector (3).
        variance: Of the line along each direction across it, at the point, in m^2.

    Returns:
        The new estimate and its covariance.
    """
    ex, ey, ez, fx, fy, fz = across(*u)
    cx, cy, cz = c
    q, Q = measure(p, P, (ex, ey, ez), ex * cx + ey * cy + ez * cz, variance)
    return measure(q, Q, (fx, fy, fz), fx * cx + fy * cy + fz * cz, variance)
