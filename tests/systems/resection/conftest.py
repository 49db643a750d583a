"""A small tumour that many tests resect."""

import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.tissue import SyntheticTumour, Tissue, synthetic_tumour
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.session import Session


@pytest.fixture(scope="session")
def ball_tissue() -> Tissue:
    """A ball of 30 mm, 1 mm voxels."""
    return synthetic_tumour(SyntheticTumour(length=0.03, lobes=0, roughness=0.0))


@pytest.fixture(scope="session")
def ball_session(ball_tissue):
    """Makes a fresh session on the ball, 1 mm voxels unless told."""

    def make(spacing: float = 1e-3, params: SnakeParams | None = None) -> Session:
        params = params or SnakeParams()
        access = Access(direction=[0.0, 0.0, -1.0])
        volume = make_volume(ball_tissue, access, params.body_radius, spacing)
        return Session(volume, params)

    return make
