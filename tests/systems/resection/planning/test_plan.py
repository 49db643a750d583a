"""Reach, planner and map on a small tumour, and the plan checked from outside."""

import hashlib
import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

from plants.snake.kinematics import centreline
from plants.snake.snake_body import body_of
from plants.tissue.space import SOLID
from plants.tissue.tissue_carver import Carving
from systems.resection.planning.feasibility_map import feasibility_map
from systems.resection.planning.planner import Planner, PlannerParams
from systems.resection.planning.reach import find_reach
from tests.ball import ball_session

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def planned():
    session = ball_session()
    reach = find_reach(session, effort=0.25)
    Planner(session, reach, PlannerParams()).run()
    return session, reach


def test_most_of_the_reachable_part_is_planned(planned):
    session, reach = planned
    assert reach.fraction > 0.75
    assert session.fraction >= 0.97 * reach.fraction
    assert sum(lump.volume for lump in reach.lumps) > 0.0
    assert all(lump.reason for lump in reach.lumps)
    assert session.steps[0].kind == "entry" and session.steps[-1].kind == "home"


def test_plan_is_free_by_an_independent_check(planned):
    """Each pose: body balls in space freed before, tool in the tumour or channel."""
    session, _ = planned
    v = session.volume
    points = v.points(np.ones(v.labels.shape, bool))
    tau, allowed = v.tau.reshape(-1), v.allowed.reshape(-1)
    rng = np.random.default_rng(0)
    x = session.postures
    for time in rng.choice(len(x), 150, replace=False):
        c = centreline(x[time], session.params)
        near = np.linalg.norm(points - c[7], axis=1) <= session.params.tool_radius
        assert allowed[near].all()
        for ball in c[:6]:
            body = np.linalg.norm(points - ball, axis=1) <= session.params.body_radius
            assert (tau[body] <= time).all()


def test_nothing_stands_out_between_the_checks(planned):
    """Carved ten times finer than it was checked, tool 0.01 mm smaller, body wider."""
    session, _ = planned
    carving = Carving(session.volume, session.params)
    carving.body = body_of(session.params, clearance=0.01e-3)._replace(
        radius=session.params.tool_radius - 0.01e-3
    )
    x = session.postures
    for index in range(len(x) - 1):
        hits = carving.move(index, x[index], x[index + 1], 0.1e-3)[2]
        assert hits == 0, f"on the way to posture {index + 1}"


def test_a_tool_without_power_frees_nothing(planned):
    session, _ = planned
    carving = Carving(session.volume, session.params)
    deep = int(np.argmax(session.postures[:, 0]))
    ends = session.postures[deep - 1 : deep + 1]
    tumour, healthy, _, _, way = carving.move(0, *ends, 1e-4, cutting=False)
    assert (tumour, healthy) == (0, 0) and way > 0.0
    assert sum(carving.move(1, *ends, 1e-4)[:2]) > 0


def digest() -> str:
    """Of a whole plan, on voxels of 2 mm: reach with reasons, postures, space."""
    session = ball_session(2e-3)
    reach = find_reach(session, effort=0.1)
    Planner(session, reach, PlannerParams(tightenings=1)).run()
    tree = session.tree.route[: len(session.postures)]
    parts = [reach.mask, session.postures, tree, session.volume.tau]
    content = b"".join(part.tobytes() for part in parts)
    return hashlib.sha256(content + repr(reach.lumps).encode()).hexdigest()


def test_same_seed_same_plan(planned):
    """In any process, after other searches, fast or slow, whatever hashes are."""
    program = f"from {__name__} import digest; print(digest())"
    both = [
        subprocess.Popen(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed in ("1", "2")  # at the same time: they slow each other down
    ]
    plans = [process.communicate()[0].strip() for process in both]
    assert plans == [digest()] * 2


def test_the_budget_counts_strokes():
    session = ball_session(2e-3)
    params = PlannerParams(budget=7, tightenings=0)
    planner = Planner(session, session.volume.allowed > 0, params)
    planner.run()
    assert planner.tried == params.budget
    assert 0.3 < planner.share < params.target
    assert session.steps[-1].kind == "home"


def test_map_says_where(planned):
    session = ball_session()
    Planner(session, session.volume.allowed > 0).enter()
    tau = session.volume.tau.copy()
    found = feasibility_map(session, 60)
    assert found.feasible.any() and not found.feasible.all()
    assert all(bool(r) != f for r, f in zip(found.reasons, found.feasible, strict=True))
    np.testing.assert_array_equal(session.volume.tau, tau)
    assert (tau == SOLID).any()
