"""Sight, and the camera that plans."""

import numpy as np
import pytest

from plants.organs.distance import Organs
from plants.organs.distance_grid import build
from plants.organs.organs import OrganSet
from plants.organs.shapes import shape
from systems.common.signals import ViewCone
from systems.motion.camera_way import expected_loss, share_at
from systems.motion.endoscope import EndoscopeParams, constants, follow
from systems.motion.sight import (
    cone_margin,
    organ_margin,
    shaft_margin,
    swept_margin,
    tip_margin,
)

NOTHING = OrganSet.nothing()
NO_ORGANS = Organs(NOTHING.values[0], NOTHING.table[0], np.zeros((1, 6)))
VIEW = ViewCone((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.6)
TIP = (0.0, 0.0, -0.1)


def test_the_border_of_the_picture_is_an_angle_away():
    p = (0.1 * np.tan(0.4), 0.0, -0.1)
    assert cone_margin(VIEW, TIP) == pytest.approx(0.6)
    assert cone_margin(VIEW, p) == pytest.approx(0.2)


def test_a_shaft_across_hides_and_one_beside_does_not():
    across = shaft_margin(VIEW, TIP, (-0.1, 0.0, -0.05), (0.1, 0.0, -0.05))
    beside = shaft_margin(VIEW, TIP, (-0.1, 0.02, -0.05), (0.1, 0.02, -0.05))
    behind = shaft_margin(VIEW, TIP, (-0.1, 0.0, -0.12), (0.1, 0.0, -0.12))
    assert across < 0.0
    assert beside == pytest.approx(0.0175 / 0.05)
    assert behind > 0.0


def test_a_tools_own_shaft_and_another_at_its_tip_do_not_hide_it():
    own = [0.05, 0.0, 0.0, *TIP]
    other = [-0.05, 0.0, 0.0, 0.001, 0.0, -0.1]
    shafts = np.array([own, other])
    assert tip_margin(VIEW, TIP, shafts, NO_ORGANS, 0.1) > 0.03


def test_an_organ_on_the_ray_hides():
    surface = shape("gallbladder", 1, 20)
    grid = build(surface, "gall")
    row = [*grid.origin, grid.spacing, *grid.values.shape, 0, 0.0068, 0.0093]
    moved = np.zeros((1, 6))
    moved[0, 2] = -0.05
    organs = Organs(grid.values.ravel(), np.array([row]), moved)
    assert organ_margin(VIEW, TIP, organs, 0.1) < 0.0
    moved[0, 1] = 0.04
    assert organ_margin(VIEW, TIP, organs, 0.1) > 0.05


def _tools(x: float) -> np.ndarray:
    """R and S at the tip, a third tool across at x, all from far above."""
    rows = [
        [0.1, 0.1, 0.0, *TIP],
        [-0.1, 0.1, 0.0, *TIP],
        [x, -0.1, -0.03, x, 0.1, -0.07],
    ]
    return np.array(rows)


def test_what_is_swept_between_two_places_hides_though_both_ends_do_not():
    before, after, beyond = _tools(-0.03), _tools(0.03), _tools(0.06)
    assert tip_margin(VIEW, TIP, before, NO_ORGANS, 0.1) > 0.0
    assert tip_margin(VIEW, TIP, after, NO_ORGANS, 0.1) > 0.0
    assert swept_margin(VIEW, 1, before, before, after, NO_ORGANS, 0.1) < 0.0
    assert swept_margin(VIEW, 1, after, after, beyond, NO_ORGANS, 0.1) > 0.0


def test_the_reckoned_way_is_the_one_that_the_camera_goes():
    scope = EndoscopeParams(p_WG=[0.0, 0.0, 0.1], p_WS=[0.0, 0.0, -0.1])
    record, way, period = constants(scope)[0], 0.045, scope.period
    p, v = (0.0, 0.0, -0.1), (0.0, 0.0, 0.0)
    looked_at = (0.0, 0.0, p[2] - way - scope.standoff)
    for k in range(180):
        p, v = follow(record, p, v, looked_at, True)
        gone = (-0.1 - p[2]) / way
        assert share_at(record, way, (k + 1) * period) == pytest.approx(gone, abs=0.08)


def test_to_go_ahead_of_a_tool_that_comes_is_no_loss_and_to_stay_is():
    scope = constants(EndoscopeParams(p_WG=[0.0, 0.0, 0.08]))[0]
    comes, there = _tools(-0.03), _tools(0.006)
    lens = (0.0, 0.0, 0.0)
    told = (1.5, comes, there, NO_ORGANS, 1e3)
    stays = expected_loss(scope, lens, lens, *told)
    goes = expected_loss(scope, lens, (0.03, 0.0, 0.0), *told)
    crosses = expected_loss(scope, lens, (-0.06, 0.0, 0.0), *told)
    assert goes == 0.0
    assert 0.0 < stays < 1.5
    assert crosses > 0.0
