"""A small tumour that many tests resect."""

import pytest

from plants.snake.parameters import SnakeParams
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.session import Session


@pytest.fixture(scope="session")
def ball_session(ball_tissue):
    """Makes a fresh session on the ball, 1 mm voxels unless told."""

    def make(spacing: float = 1e-3, params: SnakeParams | None = None) -> Session:
        params = params or SnakeParams()
        access = Access(direction=[0.0, 0.0, -1.0])
        volume = make_volume(ball_tissue, access, params.body_radius, spacing)
        return Session(volume, params)

    return make
