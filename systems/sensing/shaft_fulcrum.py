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
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import (
    along,
    any_perpendicular,
    cross,
    dot,
    over,
    scaled,
    sub,
    unit,
)
from systems.common.signal import Vector
from systems.sensing.optical_tracker import MarkerBody

type PointCovariance = tuple[float, float, float, float, float, float]
"""Of a point in W: (xx, xy, xz, yy, yz, zz) in m^2."""

FIRST = -1.0
"""Stands for the time since the frame before at the first frame."""
_QUIET = 4e-3  # rad, that the shaft may turn before its reference direction follows
_NEAREST = 0.05  # m, from the markers' mean: a nearer fulcrum gives no direction


class FulcrumState(NamedTuple):
    """p_WG in m, its covariance, and the shaft's reference direction."""

    g: Vector
    P: PointCovariance
    reference: Vector


class Sight(NamedTuple):
    """The tip that a line and the fulcrum give together.

    Attributes:
        tip: p_WP in m.
        variance: Along each axis, of its noise, in m^2.
        shared: Of the error that it takes over from the fulcrum, in m^2: that one is
            slow, so that no filtering reduces it.
    """

    tip: Vector
    variance: float
    shared: float


@compiled
def lateral_variance(P: PointCovariance, u: Vector) -> float:
    """Mean variance of a point across the direction u (unit vector), in m^2."""
    xx, xy, xz, yy, yz, zz = P
    ux, uy, uz = u
    lengthwise = ux * (ux * xx + 2.0 * (uy * xy + uz * xz))
    lengthwise += uy * (uy * yy + 2.0 * uz * yz) + uz * uz * zz
    return max(0.5 * (xx + yy + zz - lengthwise), 0.0)


@compiled
def measure(
    p: Vector, P: PointCovariance, h: Vector, value: float, variance: float
) -> tuple[Vector, PointCovariance]:
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
    xx, xy, xz, yy, yz, zz = P
    a = dot((xx, xy, xz), h), dot((xy, yy, yz), h), dot((xz, yz, zz), h)  # P h
    k = over(a, dot(h, a) + variance)
    (ax, ay, az), (kx, ky, kz), (hx, hy, hz) = a, k, h
    innovation = value - hx * p[0] - hy * p[1] - hz * p[2]
    return along(p, innovation, k), (
        xx - kx * ax,
        xy - kx * ay,
        xz - kx * az,
        yy - ky * ay,
        yz - ky * az,
        zz - kz * az,
    )


@compiled
def measure_line(
    p: Vector,
    P: PointCovariance,
    c: Vector,
    u: Vector,
    reference: Vector,
    variance: float,
) -> tuple[Vector, PointCovariance]:
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
    # Where the line pierces the plane through the estimate, across the reference.
    c = along(c, dot(sub(p, c), reference) / dot(u, reference), u)
    e = any_perpendicular(reference)
    f = cross(reference, e)
    q, Q = measure(p, P, e, dot(e, c), variance)
    return measure(q, Q, f, dot(f, c), variance)


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


def initial_fulcrum(given: list[float] | None) -> FulcrumState:
    """The state before the first frame, of a fulcrum that is given or not."""
    x, y, z = given or [0.0, 0.0, 0.0]
    return FulcrumState((x, y, z), (0.0,) * 6, (0.0, 0.0, -1.0))


@compiled
def expected_fulcrum(params: Any, c: Vector, u: Vector) -> FulcrumState:
    """The fulcrum that is expected of a shaft when nothing else is known."""
    g = along(c, params.lever - params.depth, u)
    var = params.sigma_depth**2
    P = (var, 0.0, 0.0, var, 0.0, var)
    sigma = params.sigma_wall
    g, P = measure(g, P, (0.0, 0.0, 1.0), params.wall_height, sigma * sigma)
    return FulcrumState(g, P, u)


@compiled
def absorb_line(
    params: Any, state: FulcrumState, c: Vector, u: Vector, dt: float
) -> tuple[FulcrumState, Sight]:
    """Fuses the shaft's direction with the fulcrum's, and refines the fulcrum.

    Args:
        params: A record with `shaft_constants` and what is known beforehand; a line
            that passes the fulcrum at more than `gate` standard deviations belongs to
            another fulcrum.
        state: Before the frame.
        c: Measured mean of the markers in m.
        u: Measured direction of the shaft, a unit vector.
        dt: Time since the frame before in s, or `FIRST` at the first frame.

    Returns:
        The state after the frame, and the tip in it.
    """
    lever, var_c, var_u = params.lever, params.var_c, params.var_u
    g, P, r = state
    is_first = not params.given and dt < 0.0
    if is_first:
        g, P, r = expected_fulcrum(params, c, u)
    elif not params.given:
        q = params.fulcrum_drift * params.fulcrum_drift * dt
        xx, xy, xz, yy, yz, zz = P
        P = (xx + q, xy, xz, yy + q, yz, zz + q)
        if params.wall_pull > 0.0:
            variance = params.sigma_wall**2 * params.wall_pull / max(dt, 1e-3)
            g, P = measure(g, P, (0.0, 0.0, 1.0), params.wall_height, variance)
    d = sub(g, c)
    d2 = dot(d, d)
    ahead = dot(d, u)
    var_g = lateral_variance(P, u)
    var_line = var_c + d2 * var_u
    w = u
    variance, shared = params.var_tip, 0.0
    if d2 - ahead * ahead > params.gate * params.gate * (var_line + var_g):
        if not params.given:  # another fulcrum: begin again
            g, P, r = expected_fulcrum(params, c, u)
    elif ahead > _NEAREST and not is_first:
        distance = math.sqrt(d2)
        e = unit(d)
        weight = d2 * var_u / (var_line + var_g)
        rest = 1.0 - weight
        w = along(scaled(rest, u), weight, e)
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
    return FulcrumState(g, P, r), Sight(tip, variance, shared)
