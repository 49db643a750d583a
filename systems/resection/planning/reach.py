"""The reachable part: what this robot could remove through its channels at all.

A method of its own, beside the planner: after an entry in thought a tree of single
random steps grows into the tumour. Each step goes straight from a posture that was
reached towards a tissue voxel that is still there, body in free space, tool in what
it may remove, and as far as that lasts. Space only grows, so the order does not matter
and what one step freed helps all others: the tree tends to the one largest set that can
be reached. It ends when steps hardly gain anything; a longer search finds little more
(see `effort`). Its tree is the library of the planner's strokes.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
import hashlib
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.snake.kinematics import POINTS
from plants.snake.snake_body import CULPRIT, OK, body_of, check_body, place
from plants.tissue.labels import BRAIN, CRITICAL, NAMES, TUMOUR
from plants.tissue.space import FREE, SOLID, first_forbidden
from plants.tissue.volume import Volume
from systems.common.archive import (
    check_arrays,
    read_archive,
    sensible,
    write_archive,
)
from systems.common.signal import vector
from systems.resection.planning.draws import Draws, new_draws
from systems.resection.planning.entry import PILOT, entry_pass
from systems.resection.planning.growth import tilted, tool_posture
from systems.resection.planning.search import opening, search
from systems.resection.planning.session import Session

FORMAT = 2
"""Of the file of what is reachable; 2: from how many nodes it began."""

PITCH = 2e-3
"""Of the entry in thought, in m."""

LEAST_LUMP = 2e-9
"""Volume in m3 of the smallest part that is told."""


@dataclass
class Lump:
    """A connected part of the tumour that is not reached.

    Attributes:
        volume: In m3.
        where: Its place nearest to its centroid, p_W in m.
        reason: Why it is not reached.
    """

    volume: float
    where: list[float]
    reason: str


@dataclass
class Reach:
    """The reachable part.

    Attributes:
        mask: Tumour voxels that can be removed, (nx, ny, nz).
        fraction: Of the tumour, the channel's cap aside.
        time: That the search took, in s.
        steps: Postures of its tree.
        lumps: What is not reached and why, largest first.
        x: Postures beyond the nodes that the session's tree had, (n, 7).
        parent: The node or posture each was reached from, (n,): numbered as in a
            tree that has them after its own.
        nodes: How many those nodes were.
    """

    mask: NDArray[np.bool_]
    fraction: float
    time: float
    steps: int
    lumps: list[Lump]
    x: NDArray[np.float64]
    parent: NDArray[np.int32]
    nodes: int


def find_reach(
    session: Session,
    seed: int = 1,
    effort: float = 1.0,
    explain: bool = True,
    progress: Callable[[float], None] = lambda share: None,
    anew: bool = True,
    file: Path | None = None,
) -> Reach:
    """Computes the reachable part of a session's tumour.

    Args:
        session: Its volume and robot.
        seed: Of the random steps.
        effort: Scales how long a search without success goes on.
        explain: Whether to say why the rest is not reached.
        progress: Called with the share of the tumour that is reached.
        anew: From its beginning, through the first entry: what has been removed
            does not matter. Otherwise from how things stand, through the entry in
            which the robot is.
        file: Where the search is saved every few seconds, and goes on from if it was
            cut off.
    """
    start = perf_counter()
    scratch = session.thought()
    if anew:
        scratch = Session(
            session.volume.fresh(), session.own, session.clearance, session.accuracy
        )
    volume, first = scratch.volume, int(scratch.tree.size[0])
    for bend in (PILOT, session.params.max_bend):
        scratch.commit(entry_pass(scratch, bend, PITCH, "entry"))
    draws = new_draws(seed)
    key = f"{anew} {_key(session, seed, effort)}"
    search(scratch, draws, effort, progress, file, key)
    mask = volume.resected
    fraction = int(mask.sum()) / int((volume.labels == TUMOUR).sum())
    lumps = []
    if explain:
        wide = opening(volume, scratch.body.radius)
        lumps = _lumps(scratch, volume, wide, draws)
    nodes = int(scratch.tree.size[0])
    return Reach(
        mask,
        fraction,
        perf_counter() - start,
        nodes,
        lumps,
        scratch.tree.x[first:nodes].copy(),
        scratch.tree.parent[first:nodes].copy(),
        first,
    )


def save_reach(
    path: Path, reach: Reach, session: Session, seed: int, effort: float
) -> None:
    """Writes the reachable part, and what it was computed for."""
    meta = {
        "format": FORMAT,
        "key": _key(session, seed, effort),
        "fraction": reach.fraction,
        "time": reach.time,
        "steps": reach.steps,
        "nodes": reach.nodes,
        "lumps": [asdict(lump) for lump in reach.lumps],
    }
    arrays = {"mask": reach.mask, "x": reach.x, "parent": reach.parent}
    write_archive(path, meta, arrays)


def load_reach(path: Path, session: Session, seed: int, effort: float) -> Reach | None:
    """The reachable part that was saved; None if there is none for this."""
    try:
        meta, arrays = read_archive(path, "reach", FORMAT)
        if meta["key"] != _key(session, seed, effort):
            return None
        with sensible(path, "reach"):
            return _restored(meta, arrays, session)
    except ValueError:
        return None  # it can be computed again


def _restored(meta: dict[str, Any], arrays: dict[str, Any], session: Session) -> Reach:
    mask, lumps = arrays["mask"], [Lump(**row) for row in meta["lumps"]]
    check_arrays(
        arrays,
        {
            "mask": ("b1", session.volume.labels.shape),
            "x": ("f8", ("nodes", 7)),
            "parent": ("i4", ("nodes",)),
        },
    )
    share = np.count_nonzero(mask) / np.count_nonzero(session.volume.labels == TUMOUR)
    if (mask & (session.volume.labels != TUMOUR)).any() or share != meta["fraction"]:
        raise ValueError("mask and fraction are not the tumour's")
    x, parent, nodes = arrays["x"], arrays["parent"], int(meta["nodes"])
    if nodes < 1 or ((parent < 0) | (parent >= nodes + len(x))).any():
        raise ValueError("a parent that there is not")
    time, steps = float(meta["time"]), int(meta["steps"])
    return Reach(mask, share, time, steps, lumps, x, parent, nodes)


def _key(session: Session, seed: int, effort: float) -> str:
    labels = hashlib.sha256(session.volume.labels.tobytes()).hexdigest()
    body = f"{session.own} {session.clearance} {session.accuracy}"
    return f"{labels} {session.volume.margin} {body} {seed} {effort}"


TOO_NARROW = "too narrow for the tool"
NO_WAY = "no way there was found"


def _lumps(
    session: Session, volume: Volume, opening: NDArray[np.bool_], draws: Draws
) -> list[Lump]:
    """What stays, part by part, with reasons."""
    stays = (volume.labels == TUMOUR) & (volume.tau == SOLID)
    parts, _ = ndimage.label(stays, np.ones((3, 3, 3)))
    places = []
    for number, box in enumerate(ndimage.find_objects(parts), 1):
        mask = parts[box] == number
        if np.count_nonzero(mask) * volume.voxel >= LEAST_LUMP:
            corner = np.array([side.start for side in box])
            points = volume.origin + volume.spacing * (np.argwhere(mask) + corner)
            places.append((points, mask, box))
    # Of two of a size the one nearer to the channel's mouth comes first.
    places.sort(key=lambda place: (-len(place[0]), np.linalg.norm(place[0].mean(0))))
    return [
        Lump(
            len(points) * volume.voxel,
            _middle(points).tolist(),
            _reason(session, volume, points, mask, box, opening, draws),
        )
        for points, mask, box in places
    ]


def _middle(points: NDArray) -> NDArray:
    """A part's point that is nearest to its mean, where a shell has none."""
    off = np.linalg.norm(points - points.mean(axis=0), axis=1)
    middle: NDArray = points[int(np.argmin(off))]
    return middle


def _reason(
    session: Session,
    volume: Volume,
    points: NDArray,
    mask: NDArray[np.bool_],
    box: tuple[slice, ...],
    opening: NDArray[np.bool_],
    draws: Draws,
) -> str:
    """What keeps the robot from most of a lump."""
    critical = mask & (volume.allowed[box] == 0)
    narrow = mask & ~opening[box] & ~critical
    if critical.sum() > 0.5 * mask.sum():
        return "within the margin of what is critical"
    if narrow.sum() > 0.5 * mask.sum():
        return TOO_NARROW
    body, s, why = body_of(session.params), volume.space(), np.zeros(CULPRIT)
    rng = np.random.default_rng(1)
    blame: Counter[str] = Counter()
    x, c = np.empty(7), np.empty((POINTS, 3))
    for _ in range(400):
        offset = rng.normal(size=3)
        offset *= body.radius * rng.random() ** (1 / 3) / np.linalg.norm(offset)
        p = points[rng.integers(len(points))] + offset
        if first_forbidden(s, vector(p), body.radius) != FREE:
            blame[TOO_NARROW] += 1
            continue
        n = tilted(draws, (0.0, 0.0, 1.0), 0.8)
        m = tilted(draws, n, 0.6)
        if not tool_posture(body, vector(p), n, m, x):
            blame["beyond the robot's bends"] += 1
            continue
        place(body, x, c)
        if check_body(s, body, c, 0, why) == OK:
            blame[NO_WAY] += 3
            continue
        at = int(why[5])
        label = int(volume.labels.reshape(-1)[at]) if at >= 0 else BRAIN
        if label == TUMOUR:
            blame["the body would need tumour gone that stays"] += 1
        elif label == CRITICAL:
            blame["the body would touch what is critical"] += 1
        else:
            blame[f"the body would touch the {NAMES[label]}"] += 1
    bodily = [kind for kind in blame if kind != TOO_NARROW]
    return max(bodily, key=lambda kind: blame[kind]) if bodily else TOO_NARROW
