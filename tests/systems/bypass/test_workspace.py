"""The workspace: lines in cones, and places inside, against sampling."""

import numpy as np
import pytest

from systems.bypass.workspace import (
    WorkspaceParams,
    borders,
    constants,
    is_inside,
    line_in_cone,
    line_inside,
)
from systems.common import geometry
from systems.common.reach_limits import ReachLimits
from systems.common.signals import ViewCone

G = (0.0, 0.0, 0.0)
CONE = ViewCone((0.05, 0.05, 0.0), (-0.408248, -0.408248, -0.816497), 0.6)
REACH, FLOOR = ReachLimits(), -0.15
RECORD = constants(REACH, WorkspaceParams(floor=FLOOR))[0]


def allowed(p) -> bool:
    """The limits, written out."""
    q = np.linalg.norm(p)
    tilt = np.arccos(-p[2] / q)
    ray = np.subtract(p, CONE.apex)
    angle = np.arccos(ray @ CONE.u / np.linalg.norm(ray))
    return (
        REACH.min_insertion <= q <= REACH.max_insertion
        and tilt <= REACH.max_tilt
        and angle <= CONE.half - REACH.cone_margin
        and p[2] >= FLOOR
    )


def test_places_inside_are_those_within_all_limits():
    rng = np.random.default_rng(1)
    inside = 0
    for p in rng.uniform((-0.12, -0.12, -0.2), (0.12, 0.12, 0.0), (5000, 3)):
        expected = allowed(p)
        inside += expected
        assert is_inside(RECORD, CONE, G, tuple(p)) == expected, p
        room = borders(RECORD, CONE, G, tuple(p))[1]
        assert (room.min() >= -1e-12) == expected
    assert inside > 200


def test_the_part_of_a_line_inside_is_an_interval():
    rng = np.random.default_rng(2)
    for _ in range(300):
        x = tuple(rng.uniform(-0.1, 0.1, 3))
        d = geometry.unit(tuple(rng.normal(size=3)))
        low, high = line_inside(RECORD, CONE, G, x, d, -0.2, 0.2)
        for t in rng.uniform(-0.2, 0.2, 30):
            p = geometry.along(x, t, d)
            if geometry.norm(p) < REACH.min_insertion:
                continue  # not looked at here
            assert (low <= t <= high) == allowed(p)


def test_a_line_through_the_apex():
    cone = ViewCone(G, (0.0, 0.0, -1.0), 0.7)
    for _ in range(3):
        u = geometry.unit((0.1, 0.2, -0.9))
        x = geometry.along(G, 0.1, u)
        low, high = line_in_cone(x, u, cone)
        assert low == pytest.approx(-0.1, abs=1e-6) and high > 1.0
    assert line_in_cone((0.3, 0.0, 0.0), (1.0, 0.0, 0.0), cone)[0] > 0.0
