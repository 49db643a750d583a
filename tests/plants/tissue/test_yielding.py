"""Tissue that yields: smooth, seeded, and what is cut is cut where it has moved to."""

import numpy as np
import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import CHANNEL, CRITICAL, TUMOUR
from plants.tissue.volume import Volume
from plants.tissue.yielding import (
    CavityScanParams,
    Material,
    TissueShiftParams,
    YieldingTissue,
    drawn_field,
)

SIZE, SPACING = (32, 30, 36), 1e-3


@pytest.fixture
def volume():
    """A ball of tumour before a channel, something critical beside it."""
    origin = np.array([-0.016, -0.015, -0.006])
    x, y, z = np.stack(np.meshgrid(*map(np.arange, SIZE), indexing="ij")) * SPACING
    x, y, z = x + origin[0], y + origin[1], z + origin[2]
    labels = np.zeros(SIZE, np.uint8)
    labels[x**2 + y**2 + (z - 0.012) ** 2 <= 0.011**2] = TUMOUR
    labels[(x**2 + y**2 <= 0.005**2) & (z <= 0.004)] = CHANNEL
    labels[30, :, 20] = CRITICAL
    return Volume(labels, origin, SPACING, 5e-3, 0.004, np.eye(4))


def test_a_field_is_smooth_seeded_and_as_long_as_is_said(volume):
    p = volume.points(volume.labels == TUMOUR)
    one, again, other = (drawn_field(volume, seed)(p) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.1
    assert np.linalg.norm(one, axis=1).max() == pytest.approx(1.0)
    step = drawn_field(volume, 1)(p + [1e-4, 0.0, 0.0]) - one
    assert np.linalg.norm(step, axis=1).max() < 0.1  # of a length of 22 mm


def test_material_lies_where_it_was_displaced_to(volume):
    m, d = Material(volume), np.array([2e-3, 0.0, -1e-3])
    m.gone = volume.labels == TUMOUR
    m.gone &= m.places.reshape(*SIZE, 3)[..., 2] < 0.01
    labels, gone = m.shown(lambda place: np.zeros_like(place) + d)
    inner = (slice(4, -4), slice(4, -4), slice(14, -4))
    moved = np.roll(volume.labels == TUMOUR, (2, -1), (0, 2))
    np.testing.assert_array_equal((labels == TUMOUR)[inner], moved[inner])
    both = np.roll(m.gone, (2, -1), (0, 2))[inner]
    np.testing.assert_array_equal(gone[inner], both)
    assert (labels[m.fixed] == CHANNEL).all() and gone[m.fixed].all()


def test_what_is_cut_is_the_material_that_is_there(volume):
    """A cut in displaced tissue, put back: no other kind of tissue goes with it."""
    m = Material(volume)
    field = drawn_field(volume, 3)
    labels, gone = m.shown(lambda place: 2e-3 * field(place))
    m.take(lambda place: 2e-3 * field(place), (labels == TUMOUR) & ~gone, labels)
    tumour = volume.labels == TUMOUR
    assert not (m.gone & ~tumour).any()
    assert (m.gone & tumour).sum() > 0.97 * tumour.sum()


def test_points_are_seen_on_the_surface_that_moved(volume):
    truth = YieldingTissue(volume, TissueShiftParams(3e-3, 2), SnakeParams(), 1e-3)
    m = truth.material
    m.gone = (volume.labels == TUMOUR) & (m.places.reshape(*SIZE, 3)[..., 2] < 0.012)
    rng, params = np.random.default_rng(1), CavityScanParams(noise=0.0, image_noise=0.0)
    flat = truth.scan(params, rng)
    back = flat - truth.displaced()(flat)
    floor = back[np.hypot(back[:, 0], back[:, 1]) < 6e-3][:, 2]
    assert np.median(floor) == pytest.approx(0.0115, abs=3e-4)  # between voxels
    labels, gone = truth.image(params, rng)
    shown, free = m.shown(truth.displaced())
    assert np.mean(labels == shown) > 0.995 and np.mean(gone == free) > 0.995
    assert 0.4 < truth.resected < 0.6 and truth.healthy == 0.0
