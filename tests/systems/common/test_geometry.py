"""The geometry of segments against brute force and independent computation."""

from math import nan

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from systems.common import geometry
from systems.common.geometry import all_finite
from tests.loosely import loosely

any_perpendicular = loosely(geometry.any_perpendicular)
closest_on_segment = loosely(geometry.closest_on_segment)
closest_points = loosely(geometry.closest_points)
dot = loosely(geometry.dot)
limited = loosely(geometry.limited)
norm = loosely(geometry.norm)
segment_triangle_distance = loosely(geometry.segment_triangle_distance)
shaft_point_velocity = loosely(geometry.shaft_point_velocity)
unit = loosely(geometry.unit)

# A grid of millimeters makes parallel, crossing and degenerate cases frequent.
points = st.tuples(*[st.integers(-4, 4).map(lambda k: 0.01 * k)] * 3)
loose = st.tuples(*[st.floats(-0.2, 0.2)] * 3)


def brute(a0, a1, b0, b1):
    """Least distance from many points of the first segment to the second."""
    a0, a1, b0, b1 = map(np.array, (a0, a1, b0, b1))
    p = a0 + np.linspace(0.0, 1.0, 401)[:, None] * (a1 - a0)
    d = b1 - b0
    t = (p - b0) @ d / (d @ d) if d @ d > 0.0 else np.zeros(401)
    q = b0 + np.clip(t, 0.0, 1.0)[:, None] * d
    return np.linalg.norm(p - q, axis=1).min()


@settings(max_examples=400, deadline=None)
@given(st.one_of(st.tuples(*[points] * 4), st.tuples(*[loose] * 4)))
def test_closest_points_are_points_of_the_segments_and_none_are_closer(segments):
    a0, a1, b0, b1 = segments
    s, t, rho, p, q = closest_points(a0, a1, b0, b1)
    assert 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0
    np.testing.assert_allclose(p, (1 - s) * np.array(a0) + s * np.array(a1), atol=1e-12)
    np.testing.assert_allclose(q, (1 - t) * np.array(b0) + t * np.array(b1), atol=1e-12)
    assert rho == pytest.approx(np.linalg.norm(np.subtract(p, q)), abs=1e-12)
    assert rho <= brute(a0, a1, b0, b1) + 1e-8


def test_closest_points_of_crossing_segments():
    s, t, rho, p, q = closest_points((0, 0, 0), (4, 0, 0), (1, -1, 0), (1, 3, 0))
    assert (s, t, rho) == (0.25, 0.25, 0.0)
    assert p == q == (1, 0, 0)


def test_closest_points_of_skew_segments():
    # The common perpendicular of two lines 2 apart along z.
    s, t, rho, p, q = closest_points((0, 0, 0), (4, 0, 0), (3, -1, 2), (3, 1, 2))
    assert (s, t, rho) == (0.75, 0.5, 2.0)
    assert p == (3, 0, 0) and q == (3, 0, 2)


@pytest.mark.parametrize(
    "b0, b1, s, t",
    [
        ((0, 1, 0), (4, 1, 0), 1.0, 1.0),  # side by side
        ((4, 1, 0), (0, 1, 0), 1.0, 0.0),  # against each other
        ((1, 1, 0), (2, 1, 0), 0.5, 1.0),  # the second inside the first
        ((-2, 1, 0), (3, 1, 0), 0.75, 1.0),  # overlapping in part
        ((6, 1, 0), (9, 1, 0), 1.0, 0.0),  # one after the other
    ],
)
def test_parallel_segments_choose_the_pair_nearest_the_first_ones_end(b0, b1, s, t):
    got = closest_points((0, 0, 0), (4, 0, 0), b0, b1)
    assert (got.s, got.t) == (s, t)


def test_segments_of_zero_length_are_points():
    point = (1.0, 2.0, 0.0)
    s, t, rho, _, _ = closest_points(point, point, (0, 0, 0), (4, 0, 0))
    assert rho == 2.0 and t == 0.25
    s, t, rho, _, _ = closest_points((0, 0, 0), (4, 0, 0), point, point)
    assert rho == 2.0 and s == 0.25
    assert closest_points(point, point, point, point).distance == 0.0


def test_nearly_parallel_segments():
    # 1e-5 rad: the lines cross far outside, an end is closest.
    s, _, rho, _, _ = closest_points((0, 0, 0), (1, 0, 0), (0, 0.1, 0), (1, 0.09999, 0))
    assert rho == pytest.approx(0.09999, abs=1e-9) and s == 1.0


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.tuples(*[points] * 5), st.tuples(*[loose] * 5)))
def test_segment_triangle_distance_against_sampling(corners):
    p0, p1, a, b, c = corners
    distance = segment_triangle_distance(p0, p1, a, b, c)
    # The triangle as a fan of 121 segments from a to points of bc.
    ends = np.array(b) + np.linspace(0, 1, 121)[:, None] * np.subtract(c, b)
    sampled = min(closest_points(p0, p1, a, tuple(e)).distance for e in ends)
    spacing = norm(np.subtract(c, b)) / 120
    assert distance - 1e-8 <= sampled <= distance + spacing + 1e-8


def test_segment_through_and_over_a_triangle():
    triangle = ((0, 0, 0), (4, 0, 0), (0, 4, 0))
    assert segment_triangle_distance((1, 1, -1), (1, 1, 1), *triangle) == 0.0
    assert segment_triangle_distance((1, 1, 3), (1, 2, 5), *triangle) == 3.0
    assert segment_triangle_distance((-3, 1, -1), (-3, 1, 9), *triangle) == 3.0


def test_closest_on_segment_is_clamped():
    assert closest_on_segment((2, 1, 0), (0, 0, 0), (4, 0, 0)) == (0.5, 1.0)
    assert closest_on_segment((-3, 4, 0), (0, 0, 0), (4, 0, 0)) == (0.0, 5.0)


@given(loose)
def test_any_perpendicular(a):
    n = any_perpendicular(a)
    assert norm(n) == pytest.approx(1.0)
    assert abs(dot(a, n)) < 1e-12


def test_shaft_point_velocity_is_that_of_a_rigid_shaft_through_its_fulcrum():
    rng = np.random.default_rng(3)
    g, p, v = rng.normal(size=(3, 3))
    # The tip a moment later; the shaft goes through g and keeps its length.
    h = 1e-6
    length = np.linalg.norm(p - g)
    u0, u1 = (p - g) / length, (p + h * v - g) / np.linalg.norm(p + h * v - g)
    slide = np.linalg.norm(p + h * v - g) - length
    depth = 0.3 * length
    expected = (u1 * (depth + slide) - u0 * depth) / h
    np.testing.assert_allclose(shaft_point_velocity(0.3, u0, v), expected, atol=1e-5)


def test_vector_functions_against_numpy():
    rng = np.random.default_rng(7)
    for _ in range(20):
        a, b = map(tuple, rng.normal(size=(2, 3)))
        t, u = float(rng.normal()), geometry.unit(tuple(rng.normal(size=3)))
        for ours, numpys in (
            (geometry.plus(a, b), np.add(a, b)),
            (geometry.sub(a, b), np.subtract(a, b)),
            (geometry.scaled(t, a), t * np.array(a)),
            (geometry.over(a, t), np.array(a) / t),
            (geometry.along(a, t, b), a + t * np.array(b)),
            (geometry.across(a, u), a - np.dot(a, u) * np.array(u)),
            (geometry.cross(a, b), np.cross(a, b)),
        ):
            np.testing.assert_allclose(ours, numpys, rtol=1e-12, atol=1e-15)
        rows = np.zeros((2, 3))
        geometry.set_row(rows, 1, a)
        assert geometry.row_of(rows, 1) == a and not rows[0].any()


def test_small_helpers():
    assert all_finite(np.array([1.0, 2.0])) and not all_finite((1.0, 2.0, nan))
    assert not all_finite((float("inf"), -float("inf"), 0.0))
    assert unit((0, 0, 0)) == (0, 0, 0)
    assert limited((3, 4, 0), 1.0) == pytest.approx((0.6, 0.8, 0.0))
    assert limited((3, 4, 0), 6.0) == (3, 4, 0)
