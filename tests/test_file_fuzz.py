"""Damaged files of our own: a digest tells, and nonsense with a digest is refused.

Flips and cuts of sessions, executions, files of reach and search, and recordings: 200
each in the suite, 2,000 as a study. Masks have theirs in
`tests/plants/tissue/test_mask_fuzz.py`.
"""

import io
import json
from pathlib import Path
import random

import numpy as np
import pytest

from plants.surgeon.recording import load_recording, save_recording
from plants.tissue.execution import Execution, load_execution, save_execution
from plants.tissue.labels import TUMOUR
from plants.tissue.space import SOLID
from systems.common.archive import MAGIC, write_archive
from systems.resection.planning.draws import new_draws
from systems.resection.planning.procedure import Procedure
from systems.resection.planning.reach import Reach, load_reach, save_reach
from systems.resection.planning.resumed import load_session
from systems.resection.planning.search import Search, load_search, save_search
from tests.ball import ball_session

ENTRY = Procedure("entry", length=0.016, radius=0.005, pitch=1e-3, name="entry")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A session with files of all kinds, and how each is read."""
    folder = tmp_path_factory.mktemp("files")
    session = ball_session()
    assert session.commit(ENTRY).feasible
    session.save(folder / "session")
    shape = session.volume.labels.shape
    done = Execution(
        1, 2.0, 3, (1e-9, 0.0), (0.0, -1.0), 0.01, session.volume.fresh().tau
    )
    save_execution(folder / "execution", done, session.postures)
    mask = session.volume.resected
    fraction = np.count_nonzero(mask) / np.count_nonzero(
        session.volume.labels == TUMOUR
    )
    n = int(session.tree.size[0]) - 1
    x, parent = session.tree.x[1 : n + 1], session.tree.parent[1 : n + 1]
    reach = Reach(mask, float(fraction), 1.0, n, [], x, parent, 1)
    save_reach(folder / "reach", reach, session, 1, 1.0)
    going = Search(session.thought(), new_draws(1), 0.02)
    going.step()
    save_search(folder / "search", going, "key")
    times = np.arange(50) / 30
    save_recording(folder / "recording", times, np.outer(times, [0.01, 0.0, -0.1]))
    readers = {
        "session": load_session,
        "execution": lambda path: load_execution(path, session.postures, shape),
        "reach": lambda path: load_reach(path, session, 1, 1.0) or refuse(),
        "recording": load_recording,
        "search": lambda path: load_search(path, going, "key") or True,
    }
    for name, read in readers.items():
        assert read(folder / name) is not None
    return folder, readers, session


def refuse():
    raise ValueError("it is computed again")


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Some bits flipped, bytes put in, or the end cut off."""
    spoilt = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 16))):
        spoilt[rng.randrange(len(spoilt))] ^= 1 << rng.randrange(8)
    kind = rng.randrange(4)
    if kind == 0:
        del spoilt[rng.randrange(len(spoilt)) :]
    if kind == 1:
        place = rng.randrange(len(spoilt))
        spoilt[place:place] = bytes(rng.randrange(64))
    return bytes(spoilt)


def count_accepted(whole, kind: str, cases: int, path: Path) -> int:
    """How many damaged files of a kind are read; only a ValueError refuses one."""
    folder, readers, _ = whole
    data, rng, accepted = (folder / kind).read_bytes(), random.Random(kind), 0
    for _ in range(cases):
        path.write_bytes(damaged(data, rng))
        try:
            read = readers[kind](path)
        except ValueError:
            continue
        accepted += path.read_bytes() != data
        if kind == "recording":  # a digit that is another tells nobody
            assert all(np.isfinite(part).all() for part in read)
    return accepted


@pytest.mark.parametrize(
    "kind", ["session", "execution", "reach", "search", "recording"]
)
@pytest.mark.parametrize("cases", [200, pytest.param(2000, marks=pytest.mark.study)])
def test_nothing_damaged_is_taken_for_whole(whole, kind, cases, tmp_path):
    accepted = count_accepted(whole, kind, cases, tmp_path / kind)
    assert accepted == 0 or kind == "recording"


def rewritten(path: Path, change) -> Path:
    """A file with other content and a digest that is right."""
    content = io.BytesIO(path.read_bytes()[len(MAGIC) + 32 :])
    with np.load(content, allow_pickle=False) as data:
        arrays = {name: data[name].copy() for name in data.files}
    meta = json.loads(str(arrays.pop("meta")))
    change(meta, arrays)
    other = path.with_name("other")
    write_archive(other, meta, arrays)
    return other


def put(name, place, value):
    def change(meta, arrays):
        arrays[name].reshape(-1)[place] = value

    return change


@pytest.mark.parametrize(
    ("kind", "change", "told"),
    [
        ("session", put("route", -1, 10**8), "a visit to no node"),
        ("session", put("parent", 1, 10**8), "a parent that comes later"),
        ("session", put("tau", slice(None), 0), "removed that the plan does not reach"),
        ("session", put("tau", -1, 1), "removed that the plan does not reach"),
        ("session", put("x", 3, np.nan), "x holds numbers that are not finite"),
        ("session", put("labels", 5, 77), "a label that there is not"),
        ("session", lambda m, a: a.update(x=a["x"][:, :6]), "x is f8"),
        (
            "session",
            lambda m, a: a.update(route=a["route"].astype("i8")),
            "route is i8",
        ),
        ("session", lambda m, a: a.pop("tip"), "no 'tip'"),
        ("session", lambda m, a: m.pop("spacing"), "no 'spacing'"),
        ("session", lambda m, a: m.update(format=99), "has format 99"),
        (
            "session",
            lambda m, a: m["steps"][0].update(last=10**8),
            "steps that are not",
        ),
        ("session", lambda m, a: m["params"].update(max_bend=9.0), "max_bend"),
        ("execution", lambda m, a: m.update(posture=10**8), "posture 100000000"),
        ("execution", lambda m, a: m.update(time=-1.0), "below zero"),
        ("execution", lambda m, a: m.update(format=99), "has format 99"),
        ("execution", lambda m, a: a.update(tau=a["tau"][:-1]), "tau is i4"),
        ("execution", put("tau", 0, SOLID - 1), "an arrival at no move"),
        ("reach", put("mask", 0, True), "computed again"),
        ("reach", lambda m, a: m.update(fraction=1.0), "computed again"),
        ("reach", put("parent", 0, 10**8), "computed again"),
        ("reach", lambda m, a: m.update(format=99), "computed again"),
    ],
)
def test_nonsense_with_a_digest_is_refused(whole, kind, change, told):
    folder, readers, _ = whole
    other = rewritten(folder / kind, change)
    with pytest.raises(ValueError, match=told):
        readers[kind](other)
