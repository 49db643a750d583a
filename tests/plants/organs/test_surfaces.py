"""Closed surfaces, their errors, and the grids of distances made of them."""

import numpy as np
import pytest

from plants.organs.distance import Organs, distance, distances, normal, shaft_distance
from plants.organs.distance_grid import ERROR, build, kept, triangle_distance
from plants.organs.shapes import SHAPES, shape
from plants.organs.surface import Surface, SurfaceError, refuse_open, refuse_size

COARSE = 20


def one(grid) -> Organs:
    """The organs of one grid, at rest."""
    row = [*grid.origin, grid.spacing, *grid.values.shape, 0, 0.0068, 0.0093]
    return Organs(grid.values.ravel(), np.array([row]), np.zeros((1, 6)))


def exact(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Distances by brute force (n)."""
    corners = [surface.points[surface.triangles[:, k]].tolist() for k in range(3)]
    corners = [tuple(map(tuple, c)) for c in zip(*corners, strict=True)]
    return np.array(
        [min(triangle_distance(tuple(p), *c) for c in corners) for p in points.tolist()]
    )


@pytest.fixture(scope="module")
def liver():
    surface = shape("liver", 1, COARSE)
    return surface, build(surface, "liver")


@pytest.mark.parametrize("kind", SHAPES)
def test_synthetic_organs_are_closed_and_seeded(kind):
    surface = shape(kind, 1, COARSE)
    refuse_open(surface, kind)
    refuse_size(surface, kind)
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    assert np.einsum("ni,ni->", a, np.cross(b, c)) > 0.0  # turned outwards
    assert np.array_equal(surface.points, shape(kind, 1, COARSE).points)
    assert not np.array_equal(surface.points, shape(kind, 2, COARSE).points)


def test_distances_agree_with_brute_force(liver):
    surface, grid = liver
    rng = np.random.default_rng(0)
    near = surface.points[rng.integers(0, len(surface.points), 60)]
    near = near + rng.normal(0.0, 0.006, near.shape)
    found, true = distances(one(grid), 0, near), exact(surface, near)
    assert np.abs(np.abs(found) - true).mean() < 1e-4
    assert (np.abs(found) - true).max() < ERROR


def test_far_away_it_is_a_lower_bound(liver):
    surface, grid = liver
    far = np.random.default_rng(1).uniform(-0.3, 0.3, (40, 3))
    found, true = distances(one(grid), 0, far), exact(surface, far)
    outside = found > 0.0
    assert (found - true)[outside].max() < ERROR
    assert (found / true)[outside].min() > 0.5


def test_inside_is_negative_and_the_normal_leads_out(liver):
    surface, grid = liver
    organs = one(grid)
    middle = tuple(surface.points.mean(axis=0).tolist())
    assert distance(organs, 0, middle) < -0.01
    p = (middle[0], middle[1], float(surface.points[:, 2].max()) + 0.01)
    n = normal(organs, 0, p)
    assert np.linalg.norm(n) == pytest.approx(1.0)
    assert n[2] > 0.8


def test_an_organ_that_has_moved_is_elsewhere(liver):
    _, grid = liver
    rest, p = one(grid), (0.02, 0.01, 0.05)
    moved = rest._replace(moved=np.array([[0.004, -0.002, 0.001, 0.0, 0.0, 0.0]]))
    there = (p[0] + 0.004, p[1] - 0.002, p[2] + 0.001)
    assert distance(moved, 0, there) == pytest.approx(distance(rest, 0, p), abs=1e-9)


def test_the_least_distance_along_a_shaft_is_found(liver):
    _, grid = liver
    organs, rng = one(grid), np.random.default_rng(2)
    for a, b in rng.uniform(-0.12, 0.12, (30, 2, 3)):
        found, s = shaft_distance(organs, 0, tuple(a), tuple(b), 0.02)
        line = a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
        least = distances(organs, 0, line).min()
        if least < 0.02:
            assert least - 2e-5 <= found < least + 6e-4
            assert distance(organs, 0, tuple(a + s * (b - a))) == pytest.approx(found)


def test_a_hole_is_refused_and_said_where():
    surface = shape("gallbladder", 1, COARSE)
    p = surface.points[surface.triangles].mean(axis=1)
    hole = np.linalg.norm(p - p[100], axis=1) < 0.004
    with pytest.raises(SurfaceError, match=r"gall: \d+ edges are open .* mm"):
        refuse_open(Surface(surface.points, surface.triangles[~hole]), "gall")


def test_one_that_crosses_itself_is_refused_and_said_where():
    ball = shape("gallbladder", 1, COARSE)
    twice = Surface(
        np.concatenate([ball.points, ball.points + [0.01, 0.0, 0.0]]),
        np.concatenate([ball.triangles, ball.triangles + len(ball.points)]),
    )
    refuse_open(twice, "gall")
    with pytest.raises(SurfaceError, match=r"gall: it crosses itself .* mm"):
        build(twice, "gall")


def test_inside_out_is_turned():
    surface = shape("gallbladder", 1, COARSE)
    turned = build(Surface(surface.points, surface.triangles[:, ::-1].copy()), "gall")
    assert np.allclose(turned.values, build(surface, "gall").values, atol=1e-6)


def test_another_unit_is_noticed():
    surface = shape("gallbladder", 1, COARSE)
    with pytest.raises(SurfaceError, match="is its unit right"):
        refuse_size(Surface(1e3 * surface.points, surface.triangles), "gall")


def test_a_grid_is_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    surface = shape("gallbladder", 1, COARSE)
    built = kept(surface, "gall")
    (file,) = tmp_path.rglob("*.npz")
    monkeypatch.setattr("plants.organs.distance_grid.build", None)
    assert np.array_equal(kept(surface, "gall").values, built.values)
    file.write_bytes(b"damaged")
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert np.array_equal(kept(surface, "gall").values, built.values)
