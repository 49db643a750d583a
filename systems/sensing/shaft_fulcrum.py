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
from typing import Any

import numpy as np

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import (
    along,
    any_perpendicular,
    cross,
    dot,
    sub,
    unit,
    xyz,
)
from systems.sensing.optical_tracker import MarkerBody

Point = tuple[float, float, float]
PointCovariance = tuple[float, float, float, float, float, float]
"""Of a point in W: (xx, xy, xz, yy, yz, zz) in m^2."""

FIRST = -1.0
"""Stands for the time since the frame before at the first frame."""
_QUIET = 4e-3  # rad, that the shaft may turn before its reference direction follows
_NEAREST = 0.05  # m, from the markers' mean: a nearer fulcrum gives no direction


@compiled
def lateral_variance(P: PointCovariance, u: Point) -> float:
    """Mean variance of a point across the direction u (unit vector), in m^2."""
    xx, xy, xz, yy, yz, zz = P
    ux, uy, uz = u
    lengthwise = ux * (ux * xx + 2.0 * (uy * xy + uz * xz))
    lengthwise += uy * (uy * yy + 2.0 * uz * yz) + uz * uz * zz
    return max(0.5 * (xx + yy + zz - lengthwise), 0.0)


@compiled
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


@compiled
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


def shaft_constants(body: MarkerBody, given: list[float] | None) -> dict[str, Any]:
    """What `absorb_line` needs to know of a tool, by name.

    Args:
        body: The markers on the tool.
        given: p_WG in m if it is known, or None to estimate it.
    """
    # A micrometre at least: the covariance stays regular without noise.
    var_c = max(body.sigma_position(), 1e-6) ** 2
    var_u = max(body.sigma_direction(), 1e-6) ** 2
    return {
        "lever": body.lever,
        "var_c": var_c,
        "var_u": var_u,
        "var_tip": var_c + body.lever * body.lever * var_u,
        "given": given is not None,
        "fulcrum": np.array(given or [0.0] * 3, float),
    }


def initial_fulcrum(given: list[float] | None) -> list[float]:
    """The state (12) before the first frame.

    Fulcrum p_WG in m (3), its covariance (6), and the shaft's reference direction (3,
    see `measure_line`).
    """
    return [*(given or [0.0] * 3), *[0.0] * 8, -1.0]


@compiled
def expected_fulcrum(params: Any, c: Point, u: Point) -> tuple[Point, PointCovariance]:
    """The fulcrum that is expected of a shaft when nothing else is known."""
    g = along(c, params.lever - params.depth, u)
    var = params.sigma_depth**2
    P = (var, 0.0, 0.0, var, 0.0, var)
    sigma = params.sigma_wall
    return measure(g, P, (0.0, 0.0, 1.0), params.wall_height, sigma * sigma)


@compiled
def absorb_line(
    params: Any, x: Numbers, c: Point, u: Point, dt: float
) -> tuple[tuple[float, ...], Point, float, float]:
    """Fuses the shaft's direction with the fulcrum's, and refines the fulcrum.

    Args:
        params: A record with `shaft_constants` and what is known beforehand; a line
            that passes the fulcrum at more than `gate` standard deviations belongs to
            another fulcrum.
        x: State (12), see `initial_fulcrum`.
        c: Measured mean of the markers in m.
        u: Measured direction of the shaft, a unit vector.
        dt: Time since the frame before in s, or `FIRST` at the first frame.

    Returns:
        The state after the frame; the fused tip in m; the variance along each
        axis in m^2 of its noise, and of the error it takes over from the
        fulcrum: that one is slow, so that no filtering reduces it.
    """
    lever, var_c, var_u = params.lever, params.var_c, params.var_u
    g = xyz(x, 0)
    P = (x[3], x[4], x[5], x[6], x[7], x[8])
    r = xyz(x, 9)
    is_first = not params.given and dt < 0.0
    if is_first:
        g, P = expected_fulcrum(params, c, u)
        r = u
    elif not params.given:
        q = params.fulcrum_drift * params.fulcrum_drift * dt
        P = (P[0] + q, P[1], P[2], P[3] + q, P[4], P[5] + q)
    d = sub(g, c)
    d2 = dot(d, d)
    ahead = dot(d, u)
    var_g = lateral_variance(P, u)
    var_line = var_c + d2 * var_u
    w = u
    variance, shared = params.var_tip, 0.0
    if d2 - ahead * ahead > params.gate * params.gate * (var_line + var_g):
        if not params.given:  # another fulcrum: begin again
            g, P = expected_fulcrum(params, c, u)
            r = u
    elif ahead > _NEAREST and not is_first:
        distance = math.sqrt(d2)
        e = unit(d)
        weight = d2 * var_u / (var_line + var_g)
        rest = 1.0 - weight
        w = along((rest * u[0], rest * u[1], rest * u[2]), weight, e)
        ratio = weight * lever / distance
        variance = (1.0 - ratio) ** 2 * var_c
        variance += (rest * lever) ** 2 * var_u
        variance = max(variance, var_c)  # along the shaft
        shared = ratio * ratio * var_g
        if dot(e, r) < 1.0 - 0.5 * _QUIET * _QUIET:
            r = e
    if not params.given:
        g, P = measure_line(g, P, c, u, r, var_line)
    tip = along(c, lever, unit(w))
    return g + P + r, tip, variance, shared
