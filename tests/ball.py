"""A small tumour that many tests resect."""

from functools import cache

from plants.snake.parameters import SnakeParams
from plants.tissue.tissue import SyntheticTumour, Tissue, synthetic_tumour
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.session import Session

DOWN = Access(direction=[0.0, 0.0, -1.0])


@cache
def ball_tissue() -> Tissue:
    """A ball of 30 mm, 1 mm voxels."""
    return synthetic_tumour(SyntheticTumour(length=0.03, lobes=0, roughness=0.0))


def ball_session(spacing: float = 1e-3, params: SnakeParams | None = None) -> Session:
    """A fresh session on the ball, 1 mm voxels unless told."""
    params = params or SnakeParams()
    volume = make_volume(ball_tissue(), DOWN, params.body_radius, spacing)
    return Session(volume, params)
