"""Proposing an access: the direction matters more than any detail of the plan.

Directions spread over the sphere, through the tumour's centroid and its deepest
point, are tried at coarse voxels with a short search for what is reachable; the best
ones are tried again with a longer search.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import TUMOUR
from plants.tissue.tissue import Tissue
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.reach import find_reach
from systems.resection.planning.session import Session

COARSE = 1.0e-3
"""Edge of a voxel in m while directions are compared."""

FINALISTS = 3


@dataclass
class Proposal:
    """A proposed access.

    Attributes:
        access: Point and direction.
        fraction: Of the tumour that is reachable through it, at coarse voxels.
        tried: All directions tried in P and their fractions, (n, 4).
    """

    access: Access
    fraction: float
    tried: NDArray[np.float64]


def directions(count: int) -> NDArray[np.float64]:
    """Directions spread evenly over the sphere (Fibonacci), (count, 3)."""
    i = np.arange(count) + 0.5
    z, a = 1 - 2 * i / count, i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(a), r * np.sin(a), z], axis=1)


def deepest_point(tissue: Tissue) -> NDArray[np.float64]:
    """Where in P the tumour is deepest, (3,) in m."""
    inside = ndimage.distance_transform_edt(tissue.labels == TUMOUR, tissue.spacing)
    index = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return tissue.X_PV[:3, :3] @ np.array(index, float) + tissue.X_PV[:3, 3]


def propose_access(
    tissue: Tissue,
    wish: Access,
    params: SnakeParams,
    count: int = 26,
    margin: float = 1.0e-3,
    seed: int = 1,
) -> Proposal:
    """Proposes the access through which most of the tumour can be reached.

    Args:
        tissue: The tissue.
        wish: Its clearance is kept, and its point if there is one.
        params: The robot.
        count: Directions to try.
        margin: To what is critical, in m.
        seed: Of the search.

    Raises:
        ValueError: If no direction gives a channel at all.
    """
    if wish.point is not None:
        points = [list(wish.point)]
    else:
        points = [tissue.centre().tolist(), deepest_point(tissue).tolist()]
    tried: list[tuple[float, Access]] = []
    reason = ""
    for direction in directions(count):
        for point in points:
            access = Access(point, direction.tolist(), wish.clearance)
            try:
                fraction = reachable_share(tissue, access, params, margin, seed, 0.25)
            except ValueError as error:
                reason = str(error)
                continue
            tried.append((fraction, access))
    if not tried:
        raise ValueError(f"access: no direction gives a channel; the last: {reason}")
    tried.sort(key=lambda item: -item[0])
    best = max(
        (
            (reachable_share(tissue, access, params, margin, seed, 1.0), access)
            for _, access in tried[:FINALISTS]
        ),
        key=lambda item: item[0],
    )
    table = np.array([[*(a.direction or []), f] for f, a in tried])
    return Proposal(best[1], best[0], table)


def reachable_share(
    tissue: Tissue,
    access: Access,
    params: SnakeParams,
    margin: float,
    seed: int,
    effort: float,
) -> float:
    """Share of the whole tumour that can be reached, the cap counted as lost."""
    volume = make_volume(tissue, access, params.body_radius, COARSE, margin)
    reach = find_reach(Session(volume, params), seed, effort, explain=False)
    return reach.fraction * volume.tumour_volume / max(tissue.tumour_volume, 1e-12)
