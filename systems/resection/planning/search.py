"""The search behind the reachable part: a tree of single random steps, round by round.

Between two rounds it is plain arrays: what is written down then goes on as if it had
never been cut off.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.tissue.labels import TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.volume import Volume
from systems.common.archive import (
    check_arrays,
    read_archive,
    sensible,
    write_archive,
)
from systems.resection.planning.draws import WORDS, Draws
from systems.resection.planning.growth import grow
from systems.resection.planning.session import Session
from systems.resection.planning.tree import tree_of

FORMAT = 1
"""Of the file of a search."""

PAUSE = 5.0
"""Between two times that it is saved, in s; what is found is the same."""

ROUND = 20_000
"""Attempts between two looks at what is left, at effort 1."""

WEARY = 2000
"""Failed attempts after which a voxel is asked for no more, at effort 1."""

LEAST = 3
"""Voxels that a step must free."""

STALL, ROUNDS = 0.003, 3
"""A search whose last rounds gain less of the tumour than this has ended."""

ROOM = 20_000
"""Nodes and visits that a tree has room for when it is read again."""


class Search:
    """A session's tree grows, in place, until steps gain hardly anything."""

    def __init__(self, session: Session, draws: Draws, effort: float = 1.0) -> None:
        """Begins.

        Args:
            session: In thought: what steps free is gone, but no step is recorded.
            draws: Where random numbers come from.
            effort: Scales the search.
        """
        volume, radius = session.volume, session.body.radius
        can = coverable(volume, radius).reshape(-1)
        self.session, self.draws = session, draws
        self.wanted = np.flatnonzero(can & (volume.space().tau == SOLID)).astype("i4")
        self.tries = np.zeros(len(self.wanted), np.int32)
        self.gone = [int(np.count_nonzero(volume.resected))]
        self._seats = seats_of(volume, radius)
        self._attempts = max(1, round(ROUND * effort))
        self._weary = max(1, round(WEARY * effort))
        self._total = int(np.count_nonzero(volume.labels == TUMOUR))

    @property
    def share(self) -> float:
        """What is gone of the tumour."""
        return self.gone[-1] / self._total

    @property
    def ended(self) -> bool:
        """Whether nothing is left to ask for, or the last rounds gained too little."""
        gained = self.gone[-1] - self.gone[max(0, len(self.gone) - 1 - ROUNDS)]
        weary = len(self.gone) > ROUNDS and gained < STALL * self._total
        return weary or not len(self.wanted)

    def step(self) -> None:
        """Carries out a round."""
        session = self.session
        s = session.volume.space()
        session.volume.forget_journals()
        session.make_room()
        grow(
            s, session.body, session.tree, self.draws, self.wanted, self.tries,
            self._seats, self._attempts, self._weary, LEAST, False, session.why,
        )  # fmt: skip
        left = (s.tau[self.wanted] == SOLID) & (self.tries < self._weary)
        self.wanted, self.tries = self.wanted[left], self.tries[left]
        self.gone.append(self.gone[-1] + int(s.used[0]))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All that it goes on from."""
        tree = self.session.tree
        n, m, home = map(int, tree.size)
        return {
            "tau": self.session.volume.tau,
            **{"x": tree.x[:n], "parent": tree.parent[:n], "depth": tree.depth[:n]},
            **{"tip": tree.tip[:n], "route": tree.route[:m], "home": np.array([home])},
            **{"wanted": self.wanted, "tries": self.tries, "gone": np.array(self.gone)},
            **self.draws._asdict(),
        }

    def resume(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Goes on from what `arrays` had told.

        Raises:
            ValueError: If they are not of this search.
        """
        volume, a = self.session.volume, arrays
        check_arrays(a, KINDS | {"tau": ("i4", volume.tau.shape)})
        nodes = len(a["x"])
        ends = {"route": nodes, "home": nodes, "used": WORDS + 1}
        ends |= {"wanted": volume.tau.size, "gone": volume.tau.size + 1}
        for name, end in ends.items():
            if not a[name].size or ((a[name] < 0) | (a[name] >= end)).any():
                raise ValueError(f"{name}: expected from 0 to {end - 1}")
        if ((a["parent"] < -1) | (a["parent"] >= np.arange(nodes))).any():
            raise ValueError("parent: expected a node before, or -1")
        tree = a["x"], a["parent"], a["depth"], a["tip"], a["route"]
        self.session.tree = tree_of(*tree, int(a["home"][0]), ROOM, ROOM)
        volume.tau[...] = a["tau"]
        volume.refresh()
        self.wanted, self.tries, self.gone = a["wanted"], a["tries"], a["gone"].tolist()
        for mine, told in zip(self.draws, (a[f] for f in Draws._fields), strict=True):
            mine[...] = told


KINDS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    **{"tau": ("i4", ()), "x": ("f8", ("n", 7)), "parent": ("i4", ("n",))},
    **{"depth": ("i4", ("n",)), "tip": ("f8", ("n", 3)), "route": ("i4", ("m",))},
    **{"home": ("i8", (1,)), "wanted": ("i4", ("w",)), "tries": ("i4", ("w",))},
    **{"gone": ("i8", ("g",)), "words": ("i8", (624,)), "used": ("i8", (1,))},
}
"""Kinds and lengths of `Search.arrays`; the spare number of a pair may be NaN."""


def search(
    session: Session,
    draws: Draws,
    effort: float = 1.0,
    progress: Callable[[float], None] = lambda share: None,
    file: Path | None = None,
    key: str = "",
) -> None:
    """Grows a session's tree, in place, until steps gain hardly anything.

    Args:
        session: In thought: what steps free is gone, but no step is recorded.
        draws: Where random numbers come from.
        effort: Scales the search.
        progress: Called with the share of the tumour that is reached.
        file: Where it is saved every few seconds, and goes on from if it was cut off.
        key: Of what is searched: a file with another is not gone on from.
    """
    going = Search(session, draws, effort)
    if file and file.exists():
        with suppress(ValueError):  # otherwise from its beginning
            load_search(file, going, key)
    saved = perf_counter()
    while not going.ended:
        going.step()
        progress(going.share)
        if file and perf_counter() - saved > PAUSE:
            save_search(file, going, key)
            saved = perf_counter()


def save_search(path: Path, going: Search, key: str) -> None:
    """Writes where a search stands."""
    write_archive(path, {"format": FORMAT, "key": key}, going.arrays())


def load_search(path: Path, going: Search, key: str) -> None:
    """Goes on from a file.

    Raises:
        ValueError: If it is damaged, makes no sense, or is of another search.
    """
    meta, arrays = read_archive(path, "search", FORMAT)
    with sensible(path, "search"):
        if meta["key"] != key:
            raise ValueError("it is of another tumour, robot, seed or effort")
        going.resume(arrays)


def coverable(volume: Volume, radius: float) -> NDArray[np.bool_]:
    """Tumour that a ball covers which stays where it may be, (nx, ny, nz)."""
    return (volume.labels == TUMOUR) & (volume.allowed > 0) & opening(volume, radius)


def seats_of(volume: Volume, radius: float) -> NDArray[np.int32]:
    """The nearest voxel where a ball may be, flat index, of every voxel, flat."""
    fits = volume.inside >= radius / volume.spacing
    if not fits.any():
        return np.arange(fits.size, dtype=np.int32)
    nearest = ndimage.distance_transform_edt(
        ~fits, return_distances=False, return_indices=True
    )
    seats: NDArray = np.ravel_multi_index(tuple(nearest), fits.shape)
    return seats.astype(np.int32).reshape(-1)


def opening(volume: Volume, radius: float) -> NDArray[np.bool_]:
    """What a ball that stays in what it may remove can cover."""
    r = radius / volume.spacing
    fits = volume.inside >= r - 0.87
    return ndimage.distance_transform_edt(~fits) <= r + 0.87
