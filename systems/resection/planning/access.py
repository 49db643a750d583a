"""Proposing an access: the direction matters more than any detail of the plan.

Directions spread over the sphere, through the tumour's centroid and its deepest
point, are tried at coarse voxels with a short search for what is reachable; the best
ones are tried again, finer and longer, in two rounds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.snake.parameters import SnakeParams
from plants.tissue.labels import TUMOUR
from plants.tissue.tissue import Tissue
from plants.tissue.volume import Access, make_volume
from systems.resection.planning.next_entry import spread
from systems.resection.planning.reach import find_reach
from systems.resection.planning.session import Session

LOOKS = ((1.5e-3, 0.05, 8), (1.0e-3, 0.15, 3), (1.0e-3, 0.5, 1))
"""Rounds: edge of a voxel in m, effort of the search, and how many directions stay."""


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
    progress: Callable[[float], None] = lambda share: None,
) -> Proposal:
    """Proposes the access through which most of the tumour can be reached.

    Interrupted, it proposes the best of what it has tried.

    Args:
        tissue: The tissue.
        wish: Its clearance is kept, and its point if there is one.
        params: The robot.
        count: Directions to try.
        margin: To what is critical, in m.
        seed: Of the search.
        progress: Called with the share of what is to be tried that has been.

    Raises:
        ValueError: If no direction gives a channel at all.
    """
    if wish.point is not None:
        points = [list(wish.point)]
    else:
        points = [tissue.centre().tolist(), deepest_point(tissue).tolist()]
    some = [
        Access(point, direction.tolist(), wish.clearance)
        for direction in spread(count)
        for point in points
    ]
    kept = [len(some), *(stay for _, _, stay in LOOKS)]
    whole, done, reason = sum(kept[:-1]), 0, ""
    table: list[tuple[float, Access]] = []
    best: list[tuple[float, Access]] = []
    try:
        for spacing, effort, stay in LOOKS:
            tried: list[tuple[float, Access]] = []
            for access in some:
                try:
                    fraction = reachable_share(
                        tissue, access, params, margin, seed, effort, spacing
                    )
                    tried.append((fraction, access))
                except ValueError as error:
                    reason = str(error)
                done += 1
                progress(done / whole)
                table = table if best else tried
            if not tried:
                break
            best = sorted(tried, key=lambda item: -item[0])[:stay]
            some = [access for _, access in best]
    except KeyboardInterrupt:
        best = best or sorted(table, key=lambda item: -item[0])
        if not best:
            raise
    if not best:
        raise ValueError(f"access: no direction gives a channel; the last: {reason}")
    rows = np.array([[*(a.direction or []), f] for f, a in table])
    return Proposal(best[0][1], best[0][0], rows[np.argsort(-rows[:, 3])])


def reachable_share(
    tissue: Tissue,
    access: Access,
    params: SnakeParams,
    margin: float,
    seed: int,
    effort: float,
    spacing: float = 1.0e-3,
) -> float:
    """Share of the whole tumour that can be reached, the cap counted as lost."""
    volume = make_volume(tissue, access, params.body_radius, spacing, margin)
    reach = find_reach(Session(volume, params), seed, effort, explain=False)
    return reach.fraction * volume.tumour_volume / max(tissue.tumour_volume, 1e-12)
