"""What must not be touched: nothing of it is lost on the grid, at any angle."""

from itertools import product

import numpy as np
import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.critical import EXACT, Boxes, cover
from plants.tissue.labels import CAP, CRITICAL, TUMOUR
from plants.tissue.tissue import Tissue
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.resumed import load_session
from systems.resection.planning.session import Session
from tests.plants.tissue.mask_files import TURN

OBLIQUE = TURN @ [0.3, -0.5, -1.0]
"""Of a channel along none of the mask's axes."""


def ball_and_line(spacing=1e-3, radius=13e-3, gap=1e-3, size=40):
    """A ball, and beside it a line of single voxels along y."""
    axis = (np.arange(size) - size // 2) * spacing
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    labels = (x**2 + y**2 + z**2 <= radius**2).astype(np.uint8)
    labels[size // 2 + round((radius + gap) / spacing), :, size // 2] = CRITICAL
    X = np.diag([spacing] * 3 + [1.0])
    X[:3, 3] = axis[0]
    return Tissue(labels, X, "line", is_mask=True)


def boxes_of(body, volume):
    """The critical voxels of a mask in the frame of a volume."""
    index = np.argwhere(body.labels == CRITICAL)
    return Boxes(index, np.linalg.inv(volume.X_PW) @ body.X_PV)


def distances(boxes, points):
    """To the nearest box, by trying all, (n,)."""
    halves = np.linalg.norm(boxes.halves, axis=1)
    axes = boxes.halves / halves[:, None]
    best = np.full(len(points), np.inf)
    for centre in boxes.centres:
        beyond = np.maximum(np.abs((points - centre) @ axes.T) - halves, 0.0)
        best = np.minimum(best, np.linalg.norm(beyond, axis=1))
    return best


@pytest.mark.parametrize("spacing", [0.5e-3, 1e-3, 2e-3])
@pytest.mark.parametrize("direction", [[0.0, 0.0, -1.0], OBLIQUE])
def test_a_line_of_single_voxels_survives(spacing, direction):
    """Every point of every critical voxel lies in a critical voxel of the grid."""
    body = ball_and_line()
    volume = make_volume(body, Access(direction=list(direction)), 4e-3, spacing)
    boxes = boxes_of(body, volume)
    steps = np.array(list(product(np.linspace(-0.99, 0.99, 7), repeat=3)))
    points = (boxes.centres[:, None] + steps @ boxes.halves).reshape(-1, 3)
    raw = np.rint((points - volume.origin) / spacing).astype(int)
    inside = ((raw >= 0) & (raw < volume.labels.shape)).all(axis=1)
    assert inside.mean() > 0.5
    assert (volume.labels[tuple(raw[inside].T)] == CRITICAL).all()
    # And no more: a voxel of the grid is critical for something that it overlaps.
    centres = volume.points(volume.labels == CRITICAL)
    assert distances(boxes, centres).max() < 0.87 * spacing


@pytest.mark.parametrize("spacing", [0.5e-3, 2e-3])
def test_distances_are_to_the_voxels_of_the_mask(spacing):
    body = ball_and_line()
    volume = make_volume(body, Access(direction=list(OBLIQUE)), 4e-3, spacing)
    centres = volume.points(np.ones(volume.labels.shape, bool))
    exact = distances(boxes_of(body, volume), centres)
    found = volume.to_critical.ravel()
    near = exact <= EXACT
    np.testing.assert_allclose(found[near], exact[near], rtol=0.01)
    assert (found >= exact - 1e-7).all()
    assert not volume.allowed[volume.to_critical <= volume.margin].any()


def test_boxes_at_any_angle_are_covered():
    """Thick voxels against points spread over the grid's voxels."""
    rng = np.random.default_rng(1)
    X = np.eye(4)
    X[:3, :3] = TURN @ np.diag([0.8e-3, 0.8e-3, 5e-3])
    boxes = Boxes(rng.integers(-6, 7, (25, 3)) // [1, 1, 5], X)
    origin, spacing, shape = np.full(3, -5e-3), 1e-3, (11, 11, 11)
    covered, away = cover(boxes, origin, spacing, shape)
    grid = origin + spacing * np.argwhere(np.ones(shape, bool))
    steps = spacing * np.array(list(product(np.linspace(-0.49, 0.49, 7), repeat=3)))
    overlap = np.array([distances(boxes, point + steps).min() == 0.0 for point in grid])
    assert 100 < overlap.sum() < covered.sum()
    assert covered.ravel()[overlap].all()
    assert not covered[away > 0.87 * spacing].any()


def test_aligned_boxes_cover_themselves_and_no_more():
    index = np.array([[3, 4, 5], [7, 7, 7]])
    covered, away = cover(
        Boxes(index, np.diag([1e-3] * 3 + [1.0])), np.zeros(3), 1e-3, (10, 10, 10)
    )
    np.testing.assert_array_equal(np.argwhere(covered), index)
    assert away[3, 4, 7] == pytest.approx(1.5e-3)


def test_critical_beats_tumour_and_it_is_said():
    """A line at the ball's surface, on voxels as large as the gap."""
    body = ball_and_line(gap=0.0)
    volume = make_volume(body, Access(direction=[0.0, 0.0, -1.0]), 4e-3, 2e-3)
    boxes = boxes_of(body, volume)
    nearest = distances(boxes, volume.points(volume.labels == TUMOUR)).min()
    assert nearest > 0.0
    (note,) = volume.notes
    lost = float(note.split()[0]) * 1e-9
    whole = np.isin(volume.labels, (TUMOUR, CAP)).sum() * volume.voxel
    assert whole + lost == pytest.approx(body.tumour_volume, rel=0.005)
    assert "share voxels of 2 mm with what is critical and are left to it" in note


def test_a_vessel_far_above_blocks_the_channel():
    """It lies outside of the operated grid, where the channel comes from."""
    body = ball_and_line(size=100)
    labels = body.labels.copy()
    labels[:, :, 98] = np.where(np.arange(100) == 50, CRITICAL, 0)[:, None]
    above = Tissue(labels, body.X_PV, "above", is_mask=True)
    down = Access(direction=[0.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="channel runs through what is critical"):
        make_volume(above, down, 4e-3, 1e-3)
    labels[:, :, 98] = np.where(np.arange(100) == 56, CRITICAL, 0)[:, None]
    assert make_volume(above, down, 4e-3, 1e-3).labels.shape[2] < 60  # 0.5 mm beside


def test_a_session_keeps_the_voxels_of_the_mask(tmp_path):
    """Distances after resuming are the same, not to the grid's voxels."""
    body = ball_and_line()
    volume = make_volume(body, Access(direction=list(OBLIQUE)), 4e-3, 1e-3)
    Session(volume, SnakeParams()).save(tmp_path / "s")
    again = load_session(tmp_path / "s").volume
    np.testing.assert_array_equal(again.to_critical, volume.to_critical)
    np.testing.assert_array_equal(again.allowed, volume.allowed)
    assert (again.mask_volume, again.notes) == (body.tumour_volume, volume.notes)
