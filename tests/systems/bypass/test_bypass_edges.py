"""The two edges: length one of the gradients, and the shortest ways by search."""

import itertools
from math import hypot

import numpy as np
import pytest

from diagrams.gauze.kinematic_planners import NO_CONE
from diagrams.gauze.scenes import scene
from systems.bypass.shadow_body import ObstacleTool, pose_distance, way_distance
from systems.bypass.tip_edge import tip_edge
from systems.bypass.top_edge import nearest_room, top_edge
from systems.bypass.workspace import WorkspaceParams, constants
from systems.common import geometry
from systems.common.reach_limits import ReachLimits

ROOM = constants(
    ReachLimits(min_insertion=0.015, max_insertion=0.5, max_tilt=3.1),
    WorkspaceParams(floor=-0.5),
)[0]
D = 0.0095
EDGES = {"top": top_edge, "tip": tip_edge}


def routes(edge, number):
    """Length as a function of the tip, and the scene's start and edge."""
    given = scene("standing", 3, number)
    a, p_o = given.p_WGo, given.legs[0].p0

    def at(p):
        return edge(given.p_WGr, tuple(p), given.p_WPs, a, p_o, D, ROOM, NO_CONE)

    return given, at


@pytest.mark.parametrize("name", EDGES)
def test_gradients_have_length_one_and_point_along_the_way(name):
    step, seen = 1e-6, 0
    for number in range(60):
        given, at = routes(EDGES[name], number)
        is_there, _length, direction, _ = at(given.p_WPr)
        if not is_there:
            continue
        assert np.linalg.norm(direction) == pytest.approx(1.0, abs=1e-9)
        p = np.array(given.p_WPr)
        gradient = [
            (at(p + step * e).length - at(p - step * e).length) / (2.0 * step)
            for e in np.eye(3)
        ]
        if np.abs(gradient).max() > 2.0:  # a border of the edge lies between
            continue
        seen += 1
        np.testing.assert_allclose(gradient, -np.array(direction), atol=2e-4)
    assert seen > 25


def test_following_an_edge_leads_to_the_goal_in_its_length():
    """Along the shorter edge the way left falls by what was gone, free of O."""
    for number in range(40):
        given = scene("standing", 3, number)
        a, p_o = given.p_WGo, given.legs[0].p0
        tool = ObstacleTool(p_o, (0.0, 0.0, 0.0), a, D, D)
        goal = given.p_WPs
        rho = geometry.closest_points(given.p_WGr, goal, a, p_o).distance
        keep = min(D, rho - 1e-4)
        ways = [
            edge(given.p_WGr, given.p_WPr, goal, a, p_o, keep, ROOM, NO_CONE)
            for edge in EDGES.values()
        ]
        best = min(range(2), key=lambda k: ways[k].length)
        edge, total = list(EDGES.values())[best], ways[best].length
        p, gone, step = given.p_WPr, 0.0, 2e-4
        low = 1.0
        while geometry.norm(geometry.sub(goal, p)) > 1e-3 and gone < 1.1 * total:
            direction = geometry.unit(geometry.sub(goal, p))
            if way_distance(tool, given.p_WGr, p, goal) < keep:
                route = edge(given.p_WGr, p, goal, a, p_o, keep, ROOM, NO_CONE)
                assert route.is_there
                direction = route.direction
            p = geometry.along(p, step, direction)
            gone += step
            low = min(low, geometry.closest_points(given.p_WGr, p, a, p_o).distance)
        assert gone == pytest.approx(total, abs=3e-3)
        assert low > min(keep, 0.0075) - 2e-3


def test_the_ways_are_the_shortest_that_a_search_finds():
    """A random search over two via points finds nothing clearly shorter."""
    rng = np.random.default_rng(0)
    compared = 0
    for number in range(12):
        given = scene("standing", 4, number)
        g, p, goal = given.p_WGr, given.p_WPr, given.p_WPs
        a, p_o = given.p_WGo, given.legs[0].p0
        tool = ObstacleTool(p_o, (0.0, 0.0, 0.0), a, D, D)
        if min(pose_distance(tool, g, x) for x in (p, goal)) < D + 1e-3:
            continue
        ours = min(
            edge(g, p, goal, a, p_o, D, ROOM, NO_CONE).length for edge in EDGES.values()
        )
        best, spread = None, 0.05
        for _ in range(6000):
            if best is None:
                via = [tuple(rng.uniform(-0.12, 0.12, 3)) for _ in range(2)]
            else:
                via = [tuple(np.array(x) + rng.normal(0.0, spread, 3)) for x in best[1]]
                spread = max(2e-4, 0.999 * spread)
            path = [p, *via, goal]
            length = sum(
                geometry.norm(geometry.sub(y, x)) for x, y in itertools.pairwise(path)
            )
            if best is not None and length >= best[0]:
                continue
            inserted = all(geometry.norm(geometry.sub(x, g)) > 0.015 for x in via)
            if inserted and all(
                way_distance(tool, g, x, y) >= D for x, y in itertools.pairwise(path)
            ):
                best = (length, via)
        if best is not None:
            compared += 1
            assert ours < 1.01 * best[0]
    assert compared >= 5


def test_nearest_room():
    assert nearest_room(0.05, 0.01, 0.1, 0.0, 0.02) == 0.05
    assert nearest_room(0.005, 0.01, 0.1, 0.0, 0.02) == pytest.approx(0.02)
    assert nearest_room(0.04, 0.01, 0.1, 0.05, 0.02) == pytest.approx(0.03)
    assert nearest_room(0.06, 0.04, 0.1, 0.05, 0.02) == pytest.approx(0.07)
    assert np.isnan(nearest_room(0.05, 0.04, 0.06, 0.05, 0.02))
    assert np.isnan(nearest_room(0.05, 0.06, 0.04, 0.0, 0.0))


def test_the_tip_edge_keeps_to_the_floor():
    """A floor above the best depth at the edge makes the way longer, or closes it."""
    g, p, goal = (0.0, 0.0, 0.0), (-0.04, 0.0, -0.1), (0.04, 0.0, -0.1)
    a, p_o = (0.0, 0.1, 0.0), (0.0, 0.01, -0.09)
    free = tip_edge(g, p, goal, a, p_o, D, ROOM, NO_CONE)
    assert free.is_there and free.length > hypot(0.08, 0.0)
    reach = ReachLimits(max_tilt=3.1)
    low = constants(reach, WorkspaceParams(floor=-0.08))[0]
    held = tip_edge(g, p, goal, a, p_o, D, low, NO_CONE)
    assert held.is_there and held.length > free.length
    assert held.edge[2] >= -0.08 - 1e-9
    none = constants(reach, WorkspaceParams(floor=-0.02))[0]
    assert not tip_edge(g, p, goal, a, p_o, D, none, NO_CONE).is_there
