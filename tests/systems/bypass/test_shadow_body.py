"""The shadow body's properties, against the closest points of two segments."""

from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from systems.bypass.shadow_body import (
    FAR,
    ObstacleTool,
    free_depth,
    pose_distance,
    read_tool,
    way_distance,
    write_tool,
)
from systems.common import geometry, signal
from systems.common.signal import flat, size

G = (0.0, 0.0, 0.0)
D = 0.0095
MANY = settings(max_examples=300, deadline=None)


def points(low: float = -0.1, high: float = 0.1):
    """Points of a cavity, as tuples."""
    return st.tuples(*[st.floats(low, high)] * 3)


def distance(p, a, tip) -> float:
    """Distance of R's shaft with its tip at p from a tool."""
    return geometry.closest_points(G, p, a, tip).distance


def tool(a, tip) -> ObstacleTool:
    """A tool at rest."""
    return ObstacleTool(tip, (0.0, 0.0, 0.0), a, D, D)


def behind(a, tip, share, off, stretch):
    """A point of the shadow body: one within D of the tool, or behind that one."""
    near = geometry.along(geometry.along(a, share, geometry.sub(tip, a)), 0.09, off)
    return geometry.along(G, stretch, near)


@MANY
@given(
    points(),
    points(),
    *[st.tuples(st.floats(0.0, 1.0), points(), st.floats(1.0, 3.0))] * 2,
    st.floats(0.0, 1.0),
)
def test_the_shadow_body_is_convex(a, tip, one, other, share):
    assume(distance(G, a, tip) > D + 1e-3)
    p, p2 = behind(a, tip, *one), behind(a, tip, *other)
    assume(max(distance(p, a, tip), distance(p2, a, tip)) < D)
    middle = geometry.along(p, share, geometry.sub(p2, p))
    assert distance(middle, a, tip) < D + 1e-9


@MANY
@given(points(), points(), points(), st.floats(0.0, 1.0))
def test_a_shorter_insertion_is_never_nearer(a, tip, p, share):
    shorter = geometry.along(G, share, p)
    # Of ends within a nanometre the closest points take the one farther along.
    assert distance(shorter, a, tip) >= distance(p, a, tip) - 2e-9


@MANY
@given(points(), points(), points())
def test_free_depth_is_where_the_distance_falls_to_D(a, tip, p):
    assume(geometry.norm(p) > 0.01 and distance(G, a, tip) > D + 1e-4)
    assume(geometry.norm(geometry.sub(tip, a)) > 1e-3)
    u = geometry.unit(p)
    depth = free_depth(G, u, tool(a, tip), D)
    if depth < FAR:
        assert distance(geometry.along(G, depth, u), a, tip) == pytest.approx(
            D, abs=1e-8
        )
        assert distance(geometry.along(G, depth - 1e-4, u), a, tip) > D - 1e-10
    else:
        assert distance(geometry.along(G, 0.5, u), a, tip) > D - 1e-9


@settings(max_examples=60, deadline=None)
@given(points(), points(), points(), points())
@example(
    (-0.0625, 0.0, 0.0),
    (-0.03125, 0.0, 0.0),
    (0.0, 0.0, 0.0625),
    (0.0625, 7.6e-197, 0.0),
)
def test_the_triangle_test_agrees_with_brute_force(a, tip, p, goal):
    assume(geometry.norm(geometry.sub(goal, p)) > 1e-3)
    row = tool(a, tip)
    way = geometry.sub(goal, p)
    steps = 400
    least = min(
        pose_distance(row, G, geometry.along(p, k / steps, way))
        for k in range(steps + 1)
    )
    exact = way_distance(row, G, p, goal)
    # The tip moves less than this between two of the samples.
    grid = 0.5 * geometry.norm(way) / steps
    assert exact <= least + 1e-9
    assert least <= exact + grid + 1e-9


def test_a_tool_is_a_row_of_an_array():
    rows = np.zeros((2, size(ObstacleTool)))
    one = signal.example(ObstacleTool)
    write_tool(rows, 1, one)
    assert read_tool(rows[1]) == one and rows[1].tolist() == flat(one).tolist()
    assert not rows[0].any()


def test_a_ray_away_from_the_tool_is_free():
    a, tip = (0.05, 0.05, 0.0), (0.0, 0.02, -0.06)
    assert free_depth(G, (0.0, -0.6, -0.8), tool(a, tip), D) == FAR
    depth = free_depth(G, geometry.unit((0.0, 0.02, -0.06)), tool(a, tip), D)
    assert 0.04 < depth < 0.065
