"""The reachable part: what this robot could remove through this channel at all.

A method of its own, beside the planner: a tree of single random steps grows from
home into the tumour. Each step goes straight from a posture that was reached towards
a tissue voxel that is still there, body in free space, tool in what it may remove,
and as far as that lasts. Space only grows, so the order does not matter and what one
step freed helps all others: the tree tends to the one largest set that can be
reached. It ends when steps no longer gain anything; a longer search finds little more
(see `effort`).
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

from plants.snake.kinematics import POINTS, corners
from plants.snake.snake_body import CULPRIT, OK, body_of, check_body
from plants.tissue.labels import BRAIN, CRITICAL, NAMES, TUMOUR
from plants.tissue.space import FREE, SOLID, first_forbidden
from plants.tissue.volume import Volume
from systems.common.archive import (
    check_arrays,
    read_archive,
    sensible,
    write_archive,
)
from systems.resection.planning.draws import Draws, new_draws
from systems.resection.planning.growth import grow, tilted, tool_posture
from systems.resection.planning.session import Session
from systems.resection.planning.tree import grown, new_tree

FORMAT = 1
"""Of the file of what is reachable."""

ROUND = 20_000
"""Attempts between two looks at what is left."""

WEARY = 2000
"""Failed attempts after which a voxel is asked for no more, at effort 1."""

ROOMY = 40.0e-6
"""A smaller tumour, in m3, is searched longer, up to four times."""

LEAST_LUMP = 2e-9
"""Volume in m3 of the smallest part that is told."""

STALL = 0.001
"""A search whose last rounds gain less of the tumour than this has ended."""


@dataclass
class Lump:
    """A connected part of the tumour that is not reached.

    Attributes:
        volume: In m3.
        where: Its centroid in W, in m.
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
    """

    mask: NDArray[np.bool_]
    fraction: float
    time: float
    steps: int
    lumps: list[Lump]


def find_reach(
    session: Session,
    seed: int = 1,
    effort: float = 1.0,
    explain: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> Reach:
    """Computes the reachable part of a session's tumour from its beginning.

    Args:
        session: Its volume and robot; what it has removed does not matter.
        seed: Of the random steps.
        effort: Scales how long a search without success goes on.
        explain: Whether to say why the rest is not reached.
        progress: Called with the share of the tumour that is reached.
    """
    start = perf_counter()
    volume, body = session.volume.fresh(), body_of(session.params)
    s, why = volume.space(), np.zeros(CULPRIT)
    draws = new_draws(seed)
    tree = new_tree(session.home, session.tree.tip[0], ROUND, ROUND)
    tumour = (volume.labels == TUMOUR).reshape(-1)
    opening = _opening(volume, body.radius).reshape(-1)
    wanted = np.flatnonzero(tumour & opening).astype(np.int32)
    tries = np.zeros(len(wanted), np.int32)
    total = int(np.count_nonzero(tumour))
    # Where there is little room the way is harder to find, and a try costs less.
    effort *= min(max(ROOMY / (total * volume.voxel), 1.0), 4.0)
    patience, weary = max(1, round(32 * effort)), max(1, round(WEARY * effort))
    history = [0]
    while len(wanted):
        tree = grown(tree, ROUND, ROUND)
        grow(s, body, tree, draws, wanted, tries, ROUND, weary, 3, False, why)
        left = (s.tau[wanted] == SOLID) & (tries < weary)
        wanted, tries = wanted[left], tries[left]
        history.append(int(s.used[0]))
        progress(history[-1] / total)
        if len(history) > 2 * patience:
            recent = history[-1] - history[-1 - patience]
            if recent < STALL * patience / 4 * total:
                break
    mask = volume.resected
    fraction = float(np.count_nonzero(mask)) / total
    lumps = []
    if explain:
        lumps = _lumps(session, volume, opening.reshape(mask.shape), draws)
    return Reach(mask, fraction, perf_counter() - start, int(tree.size[0]), lumps)


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
        "lumps": [asdict(lump) for lump in reach.lumps],
    }
    write_archive(path, meta, {"mask": reach.mask})


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
    check_arrays(arrays, {"mask": ("b1", session.volume.labels.shape)})
    share = np.count_nonzero(mask) / np.count_nonzero(session.volume.labels == TUMOUR)
    if (mask & (session.volume.labels != TUMOUR)).any() or share != meta["fraction"]:
        raise ValueError("mask and fraction are not the tumour's")
    return Reach(mask, share, float(meta["time"]), int(meta["steps"]), lumps)


def _key(session: Session, seed: int, effort: float) -> str:
    labels = hashlib.sha256(session.volume.labels.tobytes()).hexdigest()
    return f"{labels} {session.volume.margin} {session.params} {seed} {effort}"


def _opening(volume: Volume, radius: float) -> NDArray[np.bool_]:
    """What a ball that stays in what it may remove can cover."""
    r = radius / volume.spacing
    fits = volume.inside >= r - 0.87
    return ndimage.distance_transform_edt(~fits) <= r + 0.87


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
            points.mean(axis=0).tolist(),
            _reason(session, volume, points, mask, box, opening, draws),
        )
        for points, mask, box in places
    ]


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
        if first_forbidden(s, p, body.radius) != FREE:
            blame[TOO_NARROW] += 1
            continue
        n = tilted(draws, (0.0, 0.0, 1.0), 0.8)
        m = tilted(draws, n, 0.6)
        if not tool_posture(body, p, n, m, x):
            blame["beyond the robot's bends"] += 1
            continue
        corners(x, body.h, body.tool, c)
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
