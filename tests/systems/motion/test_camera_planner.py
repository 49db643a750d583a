"""Sight, and the camera that plans."""

import numpy as np
import pytest

from plants.organs.distance import Organs
from plants.organs.distance_grid import build
from plants.organs.organs import OrganSet
from plants.organs.shapes import shape
from systems.common.signals import ViewCone
from systems.motion.sight import cone_margin, organ_margin, shaft_margin, tip_margin

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
