"""Balls against voxels, and undoing what was thought."""

import numpy as np
import pytest

from plants.tissue import space as sp
from plants.tissue.labels import BRAIN, CHANNEL, TUMOUR
from plants.tissue.volume import Volume


@pytest.fixture
def volume():
    """A ball of tumour of 12 mm radius below a channel of 5 mm radius, 1 mm voxels."""
    axis = np.arange(-16, 17) * 1e-3
    z = np.arange(-14, 30) * 1e-3
    x, y, z = np.meshgrid(axis, axis, z, indexing="ij")
    labels = np.full(x.shape, BRAIN, np.uint8)
    labels[x**2 + y**2 + (z - 0.012) ** 2 <= 0.012**2] = TUMOUR
    labels[(x**2 + y**2 <= 0.005**2) & (z <= 0.002)] = CHANNEL
    origin = np.array([-0.016, -0.016, -0.014])
    return Volume(labels, origin, 1e-3, 5e-3, 0.002, np.eye(4))


def centres(volume):
    """Centres of all voxels, (n, 3)."""
    return volume.points(np.ones(volume.labels.shape, bool))


def test_balls_agree_with_a_plain_computation(volume):
    rng = np.random.default_rng(1)
    s = volume.space()
    points = centres(volume)
    solid = volume.tau.reshape(-1) == sp.SOLID
    forbidden = volume.allowed.reshape(-1) == 0
    for _ in range(200):
        p = rng.uniform([-0.008, -0.008, 0.004], [0.008, 0.008, 0.022])
        rho = rng.uniform(0.0005, 0.004)
        within = ((points - p) ** 2).sum(axis=1) <= rho**2
        found = sp.first_solid(s, p, rho)
        assert (found == sp.FREE) == (not (within & solid).any())
        assert found < 0 or (within & solid)[found]
        found = sp.first_forbidden(s, p, rho)
        assert (found == sp.FREE) == (not (within & forbidden).any())


def test_stamps_free_what_the_ball_covers_and_can_be_rolled_back(volume):
    s = volume.space()
    before = volume.tau.copy()
    p, rho = np.array([0.0005, -0.0003, 0.011]), 0.004
    sp.stamp(s, p, rho, 7)
    within = ((centres(volume) - p) ** 2).sum(axis=1) <= rho**2
    assert ((volume.tau.reshape(-1) == 7) == within).all()
    assert s.used[0] == within.sum()
    sp.stamp(s, p, rho + 0.001, 8)
    assert (volume.tau == 7).sum() == within.sum()  # the first arrival counts
    sp.roll_back(s, 0, 0)
    np.testing.assert_array_equal(volume.tau, before)


def test_what_was_found_roomy_is_forgotten_with_the_thought(volume):
    s = volume.space()
    p = (0.0, 0.0, 0.012)
    assert sp.body_solid(s, p, 0.003) >= 0
    sp.stamp(s, p, 0.006, 1)
    assert sp.body_solid(s, p, 0.003) == sp.FREE
    assert volume.roomy.any()
    sp.roll_back(s, 0, 0)
    assert not volume.roomy.any()
    assert sp.body_solid(s, p, 0.003) >= 0


def test_plate_agrees_with_a_plain_computation(volume):
    rng = np.random.default_rng(2)
    s = volume.space()
    sp.stamp(s, (0.0, 0.0, 0.012), 0.006, 1)
    points = centres(volume)
    solid = volume.tau.reshape(-1) == sp.SOLID
    answers = set()
    for _ in range(300):
        p = rng.uniform([-0.003, -0.003, 0.008], [0.003, 0.003, 0.016])
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        length, rho = rng.uniform(0.001, 0.004), rng.uniform(0.001, 0.004)
        along = (points - p) @ n
        across = np.linalg.norm(points - p - along[:, None] * n, axis=1)
        within = (along >= 0) & (along <= length) & (across <= rho)
        found = sp.plate_solid(s, p, n, length, rho)
        assert (found == sp.FREE) == (not (within & solid).any())
        answers.add(found == sp.FREE)
    assert answers == {True, False}


def test_beyond_the_grid_is_solid_but_the_channel_goes_on(volume):
    s = volume.space()
    assert sp.first_solid(s, (0.0, 0.0, -0.2), 0.004) == sp.FREE
    assert sp.first_solid(s, (0.002, 0.0, -0.2), 0.004) == sp.OUTSIDE
    assert sp.first_solid(s, (0.1, 0.0, 0.01), 0.004) == sp.OUTSIDE


def test_undo_puts_back_what_came_later(volume):
    s = volume.space()
    sp.stamp(s, (0.0, 0.0, 0.012), 0.004, 3)
    sp.stamp(s, (0.0, 0.0, 0.015), 0.004, 5)
    early = volume.tau <= 3
    volume.undo(3)
    np.testing.assert_array_equal(volume.tau != sp.SOLID, early)
    assert (volume.at_time(3) == ((volume.labels == TUMOUR) & ~early)).all()
