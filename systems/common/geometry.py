"""Points, segments and shafts, compiled, for the control loop.

Vectors are tuples of three floats, or arrays, in one common frame, and are returned
as tuples. Lengths in meters.
"""

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from systems.common.compiled import Numbers, compiled
from systems.common.signal import Vector

# Below this share of |d1|^2 |d2|^2 two directions count as parallel
# (sin^2 of their angle; 1e-12 is an angle of 1e-6 rad).
_PARALLEL = 1e-12


@compiled
def all_finite(values: Numbers) -> bool:
    """True if no element is NaN or infinite."""
    # A sum with a NaN or an infinity in it is never finite.
    total = 0.0
    for value in values:
        total += value
    return isfinite(total)


@compiled
def xyz(values: Numbers, start: int) -> Vector:
    """The three elements of a signal from `start` on."""
    return values[start], values[start + 1], values[start + 2]


@compiled
def row_of(rows: np.ndarray, i: int) -> Vector:
    """The i-th row of an array (n, 3)."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@compiled
def column(matrix: np.ndarray, i: int) -> Vector:
    """The i-th column of an array (3, n)."""
    return matrix[0, i], matrix[1, i], matrix[2, i]


@compiled
def set_row(rows: np.ndarray, i: int, v: Vector) -> None:
    """Writes the i-th row of an array (n, 3)."""
    rows[i, 0], rows[i, 1], rows[i, 2] = v


@compiled
def dot(a: Numbers, b: Numbers) -> float:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Numbers, b: Numbers) -> Vector:
    """The vector product a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def sub(a: Numbers, b: Numbers) -> Vector:
    """The difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def plus(a: Numbers, b: Numbers) -> Vector:
    """The sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def scaled(t: float, a: Numbers) -> Vector:
    """The product t a."""
    return t * a[0], t * a[1], t * a[2]


@compiled
def over(a: Numbers, t: float) -> Vector:
    """The quotient a / t."""
    return a[0] / t, a[1] / t, a[2] / t


@compiled
def along(p: Numbers, t: float, d: Numbers) -> Vector:
    """The point p + t d."""
    return p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]


@compiled
def across(a: Numbers, u: Numbers) -> Vector:
    """The part of a that is perpendicular to the unit vector u."""
    return along(a, -dot(a, u), u)


@compiled
def norm(a: Numbers) -> float:
    """The Euclidean length."""
    return sqrt(dot(a, a))


@compiled
def unit(a: Numbers, otherwise: Vector = (0.0, 0.0, 0.0)) -> Vector:
    """The direction of `a`, or `otherwise` where `a` has none (zero length)."""
    length = norm(a)
    return otherwise if length < 1e-12 else over(a, length)


@compiled
def limited(a: Numbers, limit: float) -> Vector:
    """`a`, shortened to the length `limit` where it is longer."""
    length = norm(a)
    return scaled(1.0 if length <= limit else limit / length, a)


@compiled
def any_perpendicular(a: Numbers) -> Vector:
    """A unit vector perpendicular to `a`, always the same for the same `a`."""
    # Crossed with the axis that `a` is least aligned with.
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    if x <= y and x <= z:
        axis = (1.0, 0.0, 0.0)
    elif y <= z:
        axis = (0.0, 1.0, 0.0)
    else:
        axis = (0.0, 0.0, 1.0)
    return unit(cross(a, axis), (1.0, 0.0, 0.0))


@compiled
def clamped(t: float) -> float:
    """The number nearest to t in [0, 1]."""
    return 0.0 if t < 0.0 else 1.0 if t > 1.0 else t


@compiled
def closest_on_segment(p: Numbers, a: Numbers, b: Numbers) -> tuple[float, float]:
    """The point of segment a->b nearest to p.

    Returns:
        (t, distance): the point is a + t (b - a), t in [0, 1]; t = 0 for a
        segment of zero length.
    """
    d = sub(b, a)
    length2 = dot(d, d)
    t = clamped(dot(sub(p, a), d) / length2) if length2 > 0.0 else 0.0
    return t, norm(sub(along(a, t, d), p))


class ClosestPoints(NamedTuple):
    """Where two segments are closest: shares of their lengths, distance, points."""

    s: float
    t: float
    distance: float
    p_A: Vector
    p_B: Vector


@compiled
def closest_points(a0: Numbers, a1: Numbers, b0: Numbers, b1: Numbers) -> ClosestPoints:
    """The closest points of the segments a0->a1 and b0->b1.

    Crossing segments give distance 0. Where the closest pair is not unique
    (parallel segments side by side) it is the one farthest along the first
    segment, for a tool the one nearest to its tip. Segments of zero length
    count as points.

    Returns:
        p_A = a0 + s (a1 - a0) and p_B = b0 + t (b1 - b0) with s, t in [0, 1].
    """
    u, v, w = sub(a1, a0), sub(b1, b0), sub(a0, b0)
    a, b, c, d, e = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    if a * c <= 0.0 or a * c - b * b < _PARALLEL * a * c:
        s, t = _closest_of_ends(a0, a1, b0, b1)
    else:
        # Ericson, Real-Time Collision Detection, 5.1.9: clamp s on the
        # infinite second line, then t, then s again for the clamped t.
        s = clamped((b * e - c * d) / (a * c - b * b))
        t = (b * s + e) / c
        if t < 0.0:
            s, t = clamped(-d / a), 0.0
        elif t > 1.0:
            s, t = clamped((b - d) / a), 1.0
    p, q = along(a0, s, u), along(b0, t, v)
    return ClosestPoints(s, t, norm(sub(p, q)), p, q)


@compiled
def _closest_of_ends(
    a0: Numbers, a1: Numbers, b0: Numbers, b1: Numbers
) -> tuple[float, float]:
    """(s, t) for parallel or zero-length segments: an end is a closest point."""
    t1, d1 = closest_on_segment(a1, b0, b1)
    t0, d0 = closest_on_segment(a0, b0, b1)
    s1, e1 = closest_on_segment(b1, a0, a1)
    s0, e0 = closest_on_segment(b0, a0, a1)
    # Ties differ by rounding only: far below any tool's radius.
    tie = min(d0, d1, e0, e1) + 1e-9
    s, t = 1.0, t1
    if d1 > tie:
        s, t = -1.0, 0.0
        if e1 <= tie and s1 > s:
            s, t = s1, 1.0
        if e0 <= tie and s0 > s:
            s, t = s0, 0.0
        if d0 <= tie and s < 0.0:
            s, t = 0.0, t0
    return s, t


@compiled
def _over_face(
    p: Numbers,
    a: Numbers,
    b: Numbers,
    c: Numbers,
    n: Numbers,
) -> bool:
    """True if p lies over or under the triangle abc of normal n."""
    return (
        dot(cross(sub(b, a), sub(p, a)), n) >= 0.0
        and dot(cross(sub(c, b), sub(p, b)), n) >= 0.0
        and dot(cross(sub(a, c), sub(p, c)), n) >= 0.0
    )


@compiled
def segment_triangle_distance(
    p0: Numbers,
    p1: Numbers,
    a: Numbers,
    b: Numbers,
    c: Numbers,
) -> float:
    """Distance of the segment p0->p1 from the triangle abc; 0 if it pierces it.

    The straight motion of a tool's tip from b to c under the fulcrum a sweeps
    this triangle. A triangle without area counts as its edges.
    """
    n = cross(sub(b, a), sub(c, a))
    area2 = dot(n, n)
    least = min(
        closest_points(p0, p1, a, b).distance,
        closest_points(p0, p1, b, c).distance,
        closest_points(p0, p1, c, a).distance,
    )
    if area2 <= 1e-24:
        return least
    h0 = dot(sub(p0, a), n)
    h1 = dot(sub(p1, a), n)
    # A segment in the triangle's plane pierces nothing; its edges say how far it is.
    level = 1e-12 * sqrt(area2) * norm(sub(p1, p0))
    if h0 * h1 <= 0.0 and abs(h0 - h1) > level:
        if _over_face(along(p0, h0 / (h0 - h1), sub(p1, p0)), a, b, c, n):
            return 0.0
    else:
        if _over_face(p0, a, b, c, n):
            least = min(least, abs(h0) / sqrt(area2))
        if _over_face(p1, a, b, c, n):
            least = min(least, abs(h1) / sqrt(area2))
    return least


@compiled
def shaft_point_velocity(fraction: float, u: Numbers, v_tip: Numbers) -> Vector:
    """Velocity of the shaft's material point at `fraction` of its inserted length.

    Insertion moves all of the shaft alike; turning about the fulcrum moves it
    in proportion to the distance from the fulcrum.

    Args:
        fraction: Distance from the fulcrum over the tip's distance, in [0, 1].
        u: Unit vector along the shaft.
        v_tip: Velocity of the tip, m/s.
    """
    slide = (1.0 - fraction) * dot(u, v_tip)
    return along(scaled(fraction, v_tip), slide, u)


class Pose(NamedTuple):
    """A frame in W: its origin in m and its axes."""

    p: Vector
    x: Vector
    y: Vector
    z: Vector


@compiled
def pose_of(p: Numbers, x: Numbers, z: Numbers) -> Pose:
    """The frame at p with the axis z, and x as far as it lies across that."""
    w = unit(z)
    u = unit(across(x, w))
    return Pose(xyz(p, 0), u, cross(w, u), w)


@compiled
def outwards(X: Pose, v: Numbers) -> Vector:
    """A direction given in a frame, in W."""
    return along(along(scaled(v[0], X.x), v[1], X.y), v[2], X.z)


@compiled
def inwards(X: Pose, v: Numbers) -> Vector:
    """A direction given in W, in a frame."""
    return dot(X.x, v), dot(X.y, v), dot(X.z, v)
