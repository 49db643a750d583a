"""A further entry: where the channel of the next one should run.

What one entry leaves lies behind its mouth or where the body has no room. Channels
through the middle between the largest part that is left and the tumour's own middle,
from all sides, and channels that turn about the skull's opening towards what is left,
are tried in thought: bored, entered, and searched for what they reach. What one adds,
less a price for the healthy tissue that it bores, ranks them; the best are looked at
again with a longer search. Free space that is there is used at once.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.tissue.labels import TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.volume import Volume
from systems.common.parameter import parameter
from systems.resection.planning.draws import new_draws
from systems.resection.planning.entry import PILOT, entry_pass
from systems.resection.planning.search import coverable, search
from systems.resection.planning.session import Session

Matrix = NDArray[np.float64]

ROOM_BEFORE = 0.045
"""Length in m before the tumour in which bored tissue counts."""

TILTS = (5e-3, 10e-3)
"""How far beside the part that is left, in m, pivoted channels aim, too."""

FIRST_LOOK, SECOND_LOOK = 0.05, 0.3
"""Effort of the search for all, and for the best of them."""

PITCH = 3e-3


@dataclass
class EntriesParams:
    """Further entries."""

    most: int = parameter(1, "entries used at most", least=1, most=10)
    way: str = parameter(
        "both",
        "through the same opening of the skull, another one, or whichever gains more",
        choices=("same", "other", "both"),
    )
    opening: float = parameter(
        0.045, "from the tumour back to the skull's opening", "m", least=0.0, most=0.2
    )
    directions: int = parameter(26, "tried for another opening", least=1, most=1000)
    finalists: int = parameter(3, "that are looked at again", least=1, most=100)
    least_gain: float = parameter(
        0.005, "of the tumour that a further entry must add", least=0.0, most=1.0
    )
    price: float = parameter(
        0.25,
        "tumour that is worth as much as healthy tissue bored",
        least=0.0,
        most=100.0,
    )
    # The robot stands at home meanwhile.
    time: float = parameter(
        300.0, "in which the access robot is set anew", "s", least=0.0, most=7200.0
    )


@dataclass
class NextEntry:
    """A proposed entry.

    Attributes:
        X_WE: Its frame in W, (4, 4).
        gained: Tumour that it would add at least, in m3.
        bored: Healthy tissue that its channel takes, in m3.
        way: "same" opening of the skull, or "other".
        angle: Between its axis and the first one's, in rad.
    """

    X_WE: Matrix
    gained: float
    bored: float
    way: str
    angle: float

    def text(self, volume: Volume) -> str:
        """What it adds, as a sentence."""
        share, angle = 100 * self.gained / volume.tumour_volume, self.angle
        return (
            f"{self.way} opening, turned by {math.degrees(angle):.0f} deg: adds at "
            f"least {share:.1f} % of the tumour, bores {1e6 * self.bored:.2f} cm3 of "
            "healthy tissue"
        )


def channel_along(volume: Volume, through: Matrix, n: Matrix) -> Matrix | None:
    """The frame of a channel along a line, to the first whole disc in the tumour.

    Tumour that is gone counts as tumour.

    Args:
        volume: The volume.
        through: A point of the line in W, (3,).
        n: Its direction, unit (3,).

    Returns:
        X_WE, or None if no disc of the channel lies wholly in the tumour.
    """
    e = np.cross([0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0], n)
    e /= np.linalg.norm(e)
    f = np.cross(n, e)
    step = volume.spacing
    grid = np.arange(-volume.channel, volume.channel + step / 2, step / 2)
    u, v = (g.reshape(-1) for g in np.meshgrid(grid, grid))
    disc = u * u + v * v <= volume.channel**2
    ring = u[disc, None] * e + v[disc, None] * f
    far = float(np.linalg.norm(np.array(volume.labels.shape)) * step)
    shape = np.array(volume.labels.shape)
    for t in np.arange(-far, far, step):
        index = np.rint((through + t * n + ring - volume.origin) / step).astype(int)
        if not ((index >= 0) & (index < shape)).all():
            continue
        if (volume.allowed[tuple(index.T)] > 0).all():
            X = np.eye(4)
            X[:3, :3] = np.column_stack([e, f, n])
            X[:3, 3] = through + (t - volume.depth) * n
            return X
    return None


def bored_by(volume: Volume, X_WE: Matrix, others: list[Matrix]) -> float:
    """Healthy tissue that a channel takes near the tumour, others' aside, in m3."""
    step = volume.spacing
    grid = np.arange(-volume.channel, volume.channel + step / 2, step)
    z = np.arange(volume.depth - ROOM_BEFORE, volume.depth, step)
    x, y, z = (g.reshape(-1) for g in np.meshgrid(grid, grid, z))
    tube = x * x + y * y <= volume.channel**2
    p = np.column_stack([x, y, z])[tube] @ X_WE[:3, :3].T + X_WE[:3, 3]
    index = np.rint((p - volume.origin) / step).astype(int)
    on = ((index >= 0) & (index < np.array(volume.labels.shape))).all(axis=1)
    healthy = np.ones(len(p), bool)
    healthy[on] = volume.labels[tuple(index[on].T)] != TUMOUR
    for X in others:
        q = (p - X[:3, 3]) @ X[:3, :3]
        inside = (q[:, 2] <= volume.depth) & (
            q[:, 0] ** 2 + q[:, 1] ** 2 <= volume.channel**2
        )
        healthy &= ~inside
    return float(np.count_nonzero(healthy)) * step**3


def bored_healthy(volume: Volume) -> float:
    """Healthy tissue that the further channels of a volume took, in m3."""
    frames = [np.eye(4)] + [channel.X_WE for channel in volume.more]
    return sum(bored_by(volume, frames[k], frames[:k]) for k in range(1, len(frames)))


def spread(count: int) -> Matrix:
    """Directions spread evenly over the sphere (Fibonacci), (count, 3)."""
    i = np.arange(count) + 0.5
    z, a = 1 - 2 * i / count, i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(a), r * np.sin(a), z], axis=1)


def _lines(session: Session, params: EntriesParams) -> list[tuple[str, Matrix, Matrix]]:
    """Lines to try: the way, a point of it and its direction."""
    volume = session.volume
    left = coverable(volume, session.body.radius) & (volume.tau == SOLID)
    parts, count = ndimage.label(left)
    if count == 0:
        return []
    sizes = np.bincount(parts.reshape(-1))[1:]
    lump = volume.points(parts == 1 + int(np.argmax(sizes))).mean(axis=0)
    middle = volume.points(volume.labels == TUMOUR).mean(axis=0)
    lines = []
    if params.way != "same":
        through = (lump + middle) / 2
        lines += [("other", through, n) for n in spread(params.directions)]
    if params.way != "other":
        pivot = np.array([0.0, 0.0, -params.opening])
        aims = [lump]
        for tilt in TILTS:
            for k in range(6):
                turn = np.array([np.cos(k * np.pi / 3), np.sin(k * np.pi / 3), 0.0])
                aims.append(lump + tilt * turn)
        for aim in aims:
            n = (aim - pivot) / np.linalg.norm(aim - pivot)
            lines.append(("same", aim, n))
    return lines


def gain_of(
    session: Session, act: Callable[[Session], object], seed: int, effort: float
) -> float:
    """Tumour in m3 that can be removed yet, at least, after something is done.

    Args:
        session: How things stand; nothing changes.
        act: What is done, in thought; if it cannot be, the gain is -1.
        seed: Of the search.
        effort: Of the search.
    """
    thought = session.thought()
    try:
        act(thought)
    except ValueError:
        return -1.0
    for bend in (PILOT, session.params.max_bend):
        thought.commit(entry_pass(thought, bend, PITCH, "entry"))
    search(thought, new_draws(seed), effort)
    return thought.volume.resected_volume - session.volume.resected_volume


def entering(X_WE: Matrix) -> Callable[[Session], object]:
    """Setting a session's access robot anew."""
    return lambda session: session.enter_anew(X_WE)


def next_entries(
    session: Session,
    params: EntriesParams,
    seed: int = 1,
    progress: Callable[[float], None] = lambda share: None,
) -> list[NextEntry]:
    """The best further entries that were found, best first; none if none gains enough.

    Args:
        session: How things stand; nothing changes.
        params: What is tried.
        seed: Of the searches.
        progress: Called with the share that has been tried.
    """
    volume = session.volume
    frames = [np.eye(4)] + [channel.X_WE for channel in volume.more]
    lines = _lines(session, params)
    found: list[NextEntry] = []

    def worth(entry: NextEntry) -> float:
        return entry.gained - params.price * entry.bored

    whole = len(lines) + params.finalists
    # What a search finds without another entry is no merit of one.
    control = gain_of(session, lambda s: None, seed, SECOND_LOOK) if lines else 0.0
    for number, (way, through, n) in enumerate(lines):
        progress(number / whole)
        X = channel_along(volume, through, n)
        if X is None:
            continue
        bored = bored_by(volume, X, frames)
        if bored == 0.0:
            continue  # it is there
        gained = gain_of(session, entering(X), seed, FIRST_LOOK)
        angle = math.acos(float(np.clip(X[2, 2], -1.0, 1.0)))
        found.append(NextEntry(X, gained, bored, way, angle))
    found.sort(key=worth, reverse=True)
    best = found[: params.finalists]
    for number, entry in enumerate(best):
        progress((len(lines) + number) / whole)
        entry.gained = (
            gain_of(session, entering(entry.X_WE), seed, SECOND_LOOK) - control
        )
    best = [e for e in best if e.gained >= params.least_gain * volume.tumour_volume]
    return sorted(best, key=worth, reverse=True)
