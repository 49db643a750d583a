"""Tumours, masks and access: shapes, affines, and bad input."""

import numpy as np
import pytest
import SimpleITK as sitk

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import CAP, CRITICAL, TUMOUR
from plants.tissue.tissue import (
    SyntheticTumour,
    Tissue,
    load_mask,
    synthetic_tumour,
)
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.access import propose_access
from tests.ball import DOWN, ball_tissue


def test_synthetic_tumours_are_seeded_and_sized():
    one, two, other = (
        synthetic_tumour(SyntheticTumour(length=0.05, seed=seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.labels, two.labels)
    assert one.labels.shape != other.labels.shape or (one.labels != other.labels).any()
    sides = np.ptp(one.points(), axis=0)
    assert sides.max() == pytest.approx(0.05, abs=0.003)
    ball = synthetic_tumour(SyntheticTumour(length=0.03, lobes=0, roughness=0.0))
    assert ball.tumour_volume == pytest.approx(np.pi / 6 * 0.03**3, rel=0.06)


def test_vessel_lies_beside_the_tumour():
    tissue = synthetic_tumour(SyntheticTumour(length=0.04, vessel=0.0015))
    gap = np.linalg.norm(
        tissue.points(CRITICAL)[:, None, ::] - tissue.points()[None, ::40], axis=-1
    ).min()
    assert 0.0005 < gap < 0.006


def write(path, labels, spacing, direction, origin):
    """Writes labels (x, y, z) as an image."""
    image = sitk.GetImageFromArray(labels.transpose(2, 1, 0))
    image.SetSpacing(spacing)
    image.SetDirection(direction)
    image.SetOrigin(origin)
    sitk.WriteImage(image, str(path))


@pytest.mark.parametrize("ending", ["nrrd", "nii.gz"])
def test_masks_keep_affine_and_shape(tmp_path, ending):
    """An ellipsoid in thick, turned slices comes back as the ellipsoid."""
    index = np.stack(np.meshgrid(*map(np.arange, (44, 40, 13)), indexing="ij"), -1)
    spacing = np.array([1.0, 1.2, 4.0])
    away = (index - [22, 20, 6]) * spacing / [16.0, 14.0, 18.0]
    labels = ((away**2).sum(-1) <= 1).astype(np.uint8) * 3
    c, s = np.cos(0.5), np.sin(0.5)
    direction = [c, -s, 0, s, c, 0, 0, 0, -1.0]
    write(tmp_path / f"m.{ending}", labels, spacing, direction, [10.0, -5.0, 30.0])
    tissue = load_mask(tmp_path / f"m.{ending}")
    np.testing.assert_allclose(tissue.spacing, 1e-3 * spacing, rtol=1e-5)
    where = np.array(direction).reshape(3, 3) @ ([22, 20, 6] * spacing) + [10, -5, 30]
    np.testing.assert_allclose(tissue.centre(), 1e-3 * where, atol=2e-4)
    volume = make_volume(tissue, DOWN, 4e-3, 1e-3)
    whole = np.isin(volume.labels, (TUMOUR, CAP))
    exact = 4 / 3 * np.pi * 16 * 14 * 18 * 1e-9
    assert whole.sum() * volume.voxel == pytest.approx(exact, rel=0.05)
    long = np.ptp(volume.points(whole), axis=0)
    assert long[2] == pytest.approx(0.036, abs=0.003)


def test_bad_masks(tmp_path):
    labels = np.zeros((20, 20, 20), np.uint8)
    write(tmp_path / "empty.nrrd", labels, [1, 1, 1], np.eye(3).ravel(), [0, 0, 0])
    with pytest.raises(ValueError, match="mask is empty"):
        load_mask(tmp_path / "empty.nrrd")
    labels[2:8, 2:8, 2:8] = 1
    labels[12:17, 12:17, 12:17] = 1
    write(tmp_path / "two.nrrd", labels, [1, 1, 1], np.eye(3).ravel(), [0, 0, 0])
    with pytest.raises(ValueError, match=r"2 tumours that do not touch .*component=1"):
        load_mask(tmp_path / "two.nrrd")
    assert (load_mask(tmp_path / "two.nrrd", component=2).labels == 1).sum() == 125
    with pytest.raises(ValueError, match=r"has no label 7; there are \[0, 1\]"):
        load_mask(tmp_path / "two.nrrd", tumour=[7])
    with pytest.raises(ValueError, match="no such file"):
        load_mask(tmp_path / "none.nrrd")
    (tmp_path / "bad.nrrd").write_text("no image")
    with pytest.raises(ValueError, match="cannot be read"):
        load_mask(tmp_path / "bad.nrrd")


def test_spacing_of_zero():
    with pytest.raises(ValueError, match="longer than zero"):
        Tissue(np.ones((3, 3, 3), np.uint8), np.diag([1e-3, 1e-3, 0.0, 1.0]), "flat")
    with pytest.raises(ValueError, match="spacing=0"):
        make_volume(synthetic_tumour(SyntheticTumour()), DOWN, 4e-3, 0.0)


@pytest.mark.parametrize(
    ("access", "message"),
    [
        (Access([0.05, 0.0, 0.1], [0.0, 0.0, -1.0]), "misses the tumour by"),
        (Access([0.0, 0.0, 0.1], [0.0, 0.0, 1.0]), "leads away from the tumour"),
        (Access([0.012, 0.0, 0.0], [0.0, 0.0, -1.0]), "lies nowhere wholly"),
        (Access(direction=[0.0, 0.0, 0.0]), "expected a direction"),
        (Access(direction=[0.0, 0.0, 1.0], clearance=0.0), "clearance=0.0"),
    ],
)
def test_bad_access(access, message):
    with pytest.raises(ValueError, match=message):
        make_volume(ball_tissue(), access, 4e-3, 1e-3)


def test_channel_and_cap():
    volume = make_volume(ball_tissue(), DOWN, 4e-3, 0.5e-3)
    x, y, z = volume.points(volume.labels == CAP).T
    assert np.hypot(x, y).max() <= volume.channel
    assert z.max() <= volume.depth
    # The disc of a channel of 5 mm enters a ball of 15 mm by its sagitta.
    assert volume.depth == pytest.approx(0.015 - np.sqrt(0.015**2 - 0.005**2), abs=1e-3)


def test_the_proposed_access_is_the_best_of_those_tried(monkeypatch):
    monkeypatch.setattr("systems.resection.planning.access.COARSE", 2e-3)
    proposal = propose_access(ball_tissue(), Access(), SnakeParams(), count=1)
    assert proposal.fraction > 0.6
    assert len(proposal.tried) == 2
