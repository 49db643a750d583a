"""The taut way over organs, and the rows of the constraint."""

import numpy as np
import pytest

from plants.organs.distance import Organs, distances
from plants.organs.organs import Organ, organ_set
from systems.bypass import tool_bypass, workspace
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.clearance_constraint import constants as packed
from systems.bypass.organ_route import ORGAN, choose_way_over, taut
from systems.bypass.organ_rows import organ_rows
from systems.bypass.tool_bypass import ToolBypassParams
from systems.common.signals import ViewCone

G = (0.0, 0.0, 0.0)
START, GOAL = (-0.06, -0.03, -0.11), (0.05, 0.02, -0.12)
EVERYTHING = ViewCone((0.0, 0.0, 0.1), (0.0, 0.0, -1.0), 1.6)
NO_TOOLS = np.zeros((0, 11))
PARAMS = tool_bypass.constants(ToolBypassParams())[0]
ROOM = workspace.constants()[0]
ROWS = packed(ClearanceConstraintParams())[0]


@pytest.fixture(scope="module")
def lobe() -> Organs:
    """The liver of `gauze_organs`, a lobe across the way."""
    organ = Organ(
        name="liver",
        seed=3,
        scale=0.7,
        p_WO=[-0.005, 0.03, -0.115],
        rpy=[0.0, 0.0, -1.57],
    )
    known = organ_set([organ])
    return Organs(known.values[0], known.table[0], np.zeros((1, 6)))


def way(organs, p, goal, edge=0, waits=0):
    return choose_way_over(
        PARAMS, ROOM, EVERYTHING, organs, G, p, goal, NO_TOOLS, edge, waits
    )


def room(organs, p):
    """How much farther than must be a shaft from G to p is, by brute force, m."""
    line = np.linspace(0.0, 1.0, 300)[:, None] * np.array(p)
    return distances(organs, 0, line).min() - organs.table[0, 8]


def test_a_string_over_nothing_is_straight():
    theta = np.linspace(0.1, 1.0, 10)
    length, t, r = taut(theta, np.full(10, 1.0), 0.1, 0.12)
    assert (t, r) == (1.0, 0.12)
    assert length**2 == pytest.approx(0.1**2 + 0.12**2 - 2 * 0.012 * np.cos(1.0))


def test_a_string_over_one_gate_turns_there():
    theta = np.linspace(0.1, 1.0, 10)
    depth = np.full(10, 1.0)
    depth[4] = 0.05
    length, t, r = taut(theta, depth, 0.1, 0.12)
    assert (t, r) == (theta[4], 0.05)
    legs = [(0.1, 0.05, 0.5), (0.05, 0.12, 0.5)]
    parts = [np.sqrt(a * a + b * b - 2 * a * b * np.cos(c)) for a, b, c in legs]
    assert length == pytest.approx(sum(parts))


def test_followed_it_leads_over_the_lobe_and_keeps_clear(lobe):
    p, edge, waits, length, least = np.array(START), 0, 0, 0.0, 1.0
    straight = START + np.linspace(0.0, 1.0, 20)[:, None] * np.subtract(GOAL, START)
    assert min(room(lobe, q) for q in straight) < -0.02
    for _ in range(400):
        found = way(lobe, tuple(p), GOAL, edge, waits)
        edge, waits = found.edge, found.waits
        step = np.array(found.corner) - p
        step *= min(1.0, 0.001 / max(np.linalg.norm(step), 1e-9))
        p, length = p + step, length + np.linalg.norm(step)
        least = min(least, room(lobe, p))
        if np.linalg.norm(p - GOAL) < 1e-3:
            break
    assert np.linalg.norm(p - GOAL) < 1e-3
    assert least > 0.0
    assert length < 1.35 * np.linalg.norm(np.subtract(GOAL, START))


def test_behind_an_organ_it_waits_before_it_and_says_so(lobe):
    behind = (0.0, 0.0, -0.17)
    found = way(lobe, START, behind)
    assert found.waits == ORGAN
    assert 0.0 < room(lobe, found.aim) < 0.003
    assert np.linalg.norm(np.cross(found.aim, behind)) < 1e-6  # on the target's line


def test_rows_tell_how_the_distance_changes(lobe):
    p, rng = np.array([-0.02, 0.0, -0.083]), np.random.default_rng(0)
    rows, bounds = organ_rows(ROWS, lobe, G, tuple(p), 0.1)
    assert len(rows) > 0
    k, h = 0, 1e-4  # the nearest to the tip
    for v in rng.normal(0.0, 1.0, (5, 3)):
        change = (room(lobe, p + h * v) - room(lobe, p - h * v)) / (2 * h)
        assert rows[k] @ v == pytest.approx(change, abs=0.15)
    assert bounds[k] == pytest.approx(-ROWS["rate"] * room(lobe, p), abs=5e-3)


def test_an_organ_that_comes_asks_to_give_way(lobe):
    p = (-0.02, 0.0, -0.083)
    rows, still = organ_rows(ROWS, lobe, G, p, 0.1)
    rising = lobe._replace(moved=np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.02]]))
    _, bounds = organ_rows(ROWS, rising, G, p, 0.1)
    assert len(rows) == len(bounds)
    assert (bounds > still).any()
