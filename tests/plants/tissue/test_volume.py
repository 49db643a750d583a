"""The tumour on the operated grid: as much as the mask has, where the mask has it."""

import numpy as np
import pytest
from scipy import ndimage

from plants.tissue.labels import CAP, TUMOUR
from plants.tissue.tissue import Tissue
from plants.tissue.volume import Access, make_volume
from tests.ball import ball_tissue
from tests.plants.tissue.mask_files import TURN


def ball(radius, spacing, shift=0.0):
    """A ball in slices, some voxels beside a slice's middle."""
    size = (np.ceil(radius / spacing).astype(int) + 3) * 2
    index = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), -1)
    p = (index - size / 2 + shift) * spacing
    X = np.diag([*spacing, 1.0])
    labels = ((p**2).sum(-1) <= radius**2).astype(np.uint8)
    return Tissue(labels, X, "ball", is_mask=True)


def on_grid(body, direction, spacing):
    """Voxels of a grid that are tumour, and the volume."""
    volume = make_volume(body, Access(direction=list(direction)), 2e-3, spacing)
    return np.isin(volume.labels, (TUMOUR, CAP)), volume


@pytest.mark.parametrize("radius", [8e-3, 15e-3])
@pytest.mark.parametrize("shift", [0.0, 0.37])
@pytest.mark.parametrize("thick", [0.5, 5.0, 8.0, 10.0])
@pytest.mark.parametrize("direction", [[0, 0, -1.0], TURN @ [0.3, -0.5, -1.0]])
def test_volume_in_thick_slices(radius, shift, thick, direction):
    body = ball(radius, np.array([0.5e-3, 0.5e-3, 1e-3 * thick]), shift)
    for spacing in (0.5e-3, 1e-3):
        whole, volume = on_grid(body, direction, spacing)
        own = body.tumour_volume
        assert whole.sum() * volume.voxel == pytest.approx(own, rel=0.003)
        assert volume.mask_volume == own
        assert volume.notes == []


@pytest.mark.parametrize("thick", [5.0, 10.0])
def test_steps_are_smoothed_towards_the_ball(thick):
    """Steps of slices go; what grows beyond the drawn voxels stays small."""
    radius = 15e-3
    spacing = np.array([0.5e-3, 0.5e-3, 1e-3 * thick])
    body = ball(radius, spacing, 0.2)
    whole, volume = on_grid(body, TURN @ [0.3, -0.5, -1.0], 0.5e-3)
    p_W = volume.points(np.ones(volume.labels.shape, bool))
    p_P = p_W @ volume.X_PW[:3, :3].T + volume.X_PW[:3, 3]
    middle = (np.array(body.labels.shape) / 2 - 0.2) * spacing
    ball_on_grid = (np.linalg.norm(p_P - middle, axis=1) <= radius).reshape(whole.shape)
    index = np.rint(p_P / spacing).astype(int)
    inside = ((index >= 0) & (index < body.labels.shape)).all(axis=1)
    drawn = np.zeros(len(p_P), bool)
    drawn[inside] = body.labels[tuple(index[inside].T)] == 1
    drawn = drawn.reshape(whole.shape)

    def alike(one, other):
        return 2 * (one & other).sum() / (one.sum() + other.sum())

    assert alike(whole, ball_on_grid) > alike(drawn, ball_on_grid) + 0.02
    beyond = ndimage.distance_transform_edt(~drawn)[whole].max() * 0.5e-3
    assert beyond <= 0.25 * spacing[2]


def test_a_single_slice_stays_as_thick_as_it_is():
    labels = np.zeros((60, 60, 5), np.uint8)
    labels[15:45, 15:45, 2] = 1
    body = Tissue(labels, np.diag([0.5e-3, 0.5e-3, 8e-3, 1.0]), "slice", is_mask=True)
    whole, volume = on_grid(body, [0, 0, -1.0], 0.5e-3)
    x, y, z = np.ptp(volume.points(whole), axis=0) + 0.5e-3
    assert z == pytest.approx(8e-3, abs=1.01e-3)  # a voxel on each side
    assert (x, y) == pytest.approx((15e-3, 15e-3), abs=1.6e-3)


def test_a_synthetic_tumour_has_no_mask():
    volume = make_volume(ball_tissue(), Access(direction=[0, 0, -1.0]), 4e-3, 1e-3)
    assert volume.mask_volume is None


def test_parts_that_a_coarse_grid_cuts_off_are_said():
    """A ball and a smaller one, held together by a neck of one voxel."""
    axis = (np.arange(60) - 25) * 0.5e-3
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    labels = (x**2 + y**2 + z**2 <= 0.009**2) | (
        (x - 0.0135) ** 2 + y**2 + z**2 <= 0.002**2
    )
    labels[25:50, 25, 25] = True
    X = np.diag([0.5e-3] * 3 + [1.0])
    body = Tissue(labels.astype(np.uint8), X, "neck", is_mask=True)
    whole, volume = on_grid(body, [0, 0, -1.0], 2e-3)
    (note,) = volume.notes
    assert "mm3 of the tumour in 1 parts hang together with it by no face" in note
    lost = float(note.split()[0]) * 1e-9
    total = whole.sum() * volume.voxel + lost
    assert total == pytest.approx(body.tumour_volume, abs=volume.voxel)
