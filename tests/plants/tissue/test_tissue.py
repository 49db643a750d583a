"""Synthetic tumours and access: shapes, sizes, and bad input."""

import numpy as np
import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import CAP, CRITICAL
from plants.tissue.tissue import (
    SyntheticTumour,
    Tissue,
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
    looks = ((2e-3, 0.05, 2), (2e-3, 0.25, 1))
    monkeypatch.setattr("systems.resection.planning.access.LOOKS", looks)
    proposal = propose_access(ball_tissue(), Access(), SnakeParams(), count=1)
    assert proposal.fraction > 0.6
    assert len(proposal.tried) == 2
