"""Where an elementary volume is feasible now: a map over the surface of free space."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.snake.snake_body import BALL
from plants.tissue.labels import BRAIN, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from systems.common.signal import vector
from systems.resection.planning.feasibility import (
    IN_BRAIN,
    LIMIT,
    NEAR_CRITICAL,
    NEVER,
    TOOL_OUTSIDE,
)
from systems.resection.planning.session import Session
from systems.resection.planning.sweep import straightened, try_procedure
from systems.resection.planning.tree import nearest_nodes

NODES = 2
"""Postures of the tree from which a volume is tried."""

NOBODY = -1
"""The part that is in the way where a limit is."""

TURNS = (0.6, 0.2)
"""How far, as a share, their axes are turned towards the point."""


@dataclass
class FeasibilityMap:
    """A map.

    Attributes:
        points: On the tissue that borders free space, in W in m, (n, 3).
        gained: Tumour in m3 that an elementary volume there would remove, (n,); 0
            if none is feasible.
        reasons: "" where one is feasible, else what is in the way, n of them.
    """

    points: NDArray[np.float64]
    gained: NDArray[np.float64]
    reasons: list[str]

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Where an elementary volume is feasible, (n,)."""
        return self.gained > 0.0


def border(session: Session) -> NDArray[np.int64]:
    """Flat indices of tumour voxels that border free space."""
    volume = session.volume
    solid = (volume.labels == TUMOUR) & (volume.tau == SOLID)
    free = volume.tau != SOLID
    return np.flatnonzero(solid & ndimage.binary_dilation(free))


def feasibility_map(session: Session, *args: Any, **kwargs: Any) -> FeasibilityMap:
    """The whole of a `growing_map`, which takes the same arguments."""
    return deque(growing_map(session, *args, **kwargs), maxlen=1).pop()


def growing_map(
    session: Session,
    count: int = 1000,
    bend: float = 0.35,
    pitch: float = 3.0e-3,
    seed: int = 1,
) -> Iterator[FeasibilityMap]:
    """Tries an elementary volume at points all over the border of free space.

    The volumes are clipped, as the planner's; each starts from the nearest postures
    that were reached, turned towards the point.

    Args:
        session: How things stand; nothing changes. Between two points it may be asked
            of other procedures; once one is committed, the map is of the past.
        count: Points.
        bend: Of the volume's widest ring, in rad.
        pitch: Between rings and along them, in m.
        seed: Of the choice of points.

    Yields:
        The map as far as it is made, at first of no point.
    """
    volume, body = session.volume, session.body
    rng = np.random.default_rng(seed)
    voxels = border(session)
    if len(voxels) > count:
        voxels = rng.choice(voxels, count, replace=False)
    points = volume.origin + volume.spacing * np.column_stack(
        np.unravel_index(voxels, volume.labels.shape)
    )
    found, far = np.empty(NODES, np.int64), np.empty(NODES)
    gained, reasons = np.zeros(len(points)), []
    x = np.empty(7)
    yield FeasibilityMap(points[:0], gained[:0], [])
    for n, p in enumerate(points):
        volume.forget_journals()
        session.make_room()
        s, tree, why = volume.space(), session.tree, session.why
        nearest_nodes(tree, vector(p), found, far)
        reason = LIMIT
        for node, turn in product(found[found >= 0], TURNS):
            if not straightened(body, tree.x[node], p, turn, x):
                continue
            why[0] = NOBODY
            gain = try_procedure(
                s, body, tree, int(node), x, 0.0, pitch, bend, pitch, why
            )
            if gain > 0:
                gained[n] = gain * volume.voxel
                reason = ""
                break
            reason = _reason(session, int(why[0]))
        reasons.append(reason)
        yield FeasibilityMap(points[: n + 1], gained[: n + 1], list(reasons))


def _reason(session: Session, part: int) -> str:
    """What the culprit of the last failure is, in a word."""
    if part == NOBODY:
        return LIMIT
    at = int(session.why[5])
    label = session.volume.labels.reshape(-1)[at] if at >= 0 else BRAIN
    if label == CRITICAL:
        return NEAR_CRITICAL
    if part == BALL:
        return TOOL_OUTSIDE
    return NEVER if label == TUMOUR else IN_BRAIN
