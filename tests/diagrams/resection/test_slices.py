"""Slices show the patient as he lies, and what is planned where it is."""

import numpy as np
import pytest

from diagrams.resection.operation import new_session
from diagrams.resection.scenario import ResectionScenario
from diagrams.resection.slices import FREE, GOOD, SIZE, SLICES, TISSUE, Slices
from plants.tissue.image import Image
from plants.tissue.labels import CHANNEL, TUMOUR
from plants.tissue.tissue import SyntheticTumour
from plants.tissue.volume import Access
from tests.plants.tissue.mask_files import TURN

POINT = np.array([2e-3, -1e-3, 9e-3])


@pytest.fixture(scope="module")
def volume():
    scenario = ResectionScenario(
        tumour=SyntheticTumour(length=0.02),
        access=Access(direction=[0.3, 0.2, -1.0]),
        spacing=2e-3,
    )
    return new_session(scenario)[0].volume


def ramp(axis):
    """An image that grows by a grey each half millimetre along an axis of P."""
    X_PV = np.eye(4)
    X_PV[:3, :3] = 2e-3 * TURN
    X_PV[:3, 3] = -X_PV[:3, :3] @ np.full(3, 29.5)
    index = np.stack(np.meshgrid(*[np.arange(60)] * 3, indexing="ij"), -1)
    p_P = index @ X_PV[:3, :3].T + X_PV[:3, 3]
    return Image(np.clip(128 + 2e3 * p_P[..., axis], 0, 255).astype(np.float32), X_PV)


@pytest.mark.parametrize("name", SLICES)
def test_pixels_and_points_undo_each_other(volume, name):
    slices = Slices(volume)
    for pixel in ((0.0, 0.0), (17.5, 200.0), (239.0, 3.0)):
        p = slices.point(name, pixel, POINT)
        assert slices.pixel_of(name, p) == pytest.approx(pixel)
        assert slices.depth_of(name, p, POINT) == pytest.approx(0.0, abs=1e-12)
    assert slices.point(name, slices.pixel_of(name, POINT), POINT) == pytest.approx(
        POINT
    )


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("name", SLICES)
def test_greys_are_the_patients(volume, name, axis):
    """To the right goes his left or back, down his back or feet."""
    slices = Slices(volume, ramp(axis))
    nothing = np.zeros(volume.labels.shape, bool)
    picture = slices.picture(name, POINT, nothing, True)
    for i, j in ((4, 4), (SIZE - 5, 5), (7, SIZE - 8), (SIZE - 4, SIZE - 4)):
        p_P = slices.in_patient(slices.point(name, (i, j), POINT))
        assert picture[j, i] == pytest.approx(128 + 2e3 * p_P[axis], abs=1.0)
    right, down = SLICES[name]
    grey = picture.astype(int)
    rises = grey[5, -5, 0] - grey[5, 5, 0], grey[-5, 5, 0] - grey[5, 5, 0]
    assert np.sign(rises).tolist() == [right[axis], down[axis]]


def test_what_is_planned_is_seen(volume):
    slices, shape = Slices(volume), np.zeros(volume.labels.shape, bool)
    tumour = np.argwhere(volume.labels == TUMOUR)
    inner = tumour[np.argmin(((tumour - tumour.mean(axis=0)) ** 2).sum(axis=1))]
    for label, color in ((TUMOUR, TISSUE), (CHANNEL, FREE)):
        index = inner if label == TUMOUR else np.argwhere(volume.labels == label)[7]
        p_W = volume.origin + volume.spacing * index
        for name in SLICES:
            i, j = np.rint(slices.pixel_of(name, p_W)).astype(int)
            at = slices.picture(name, p_W, shape, True)[j, i].astype(int)
            assert np.abs(at - color).max() < 35
    shape[tuple(inner)] = True
    p_W = volume.origin + volume.spacing * inner
    i, j = np.rint(slices.pixel_of("axial", p_W)).astype(int)
    at = slices.picture("axial", p_W, shape, True)[j, i].astype(int)
    assert np.abs(at - GOOD).sum() < np.abs(at - TISSUE).sum()
