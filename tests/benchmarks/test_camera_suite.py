"""The random scenes in which a tool gets between lens and tips."""

import numpy as np

from tests.benchmarks.camera_suite import first_view, lost, margin, random_scene


def test_a_camera_that_stands_loses_the_tips_and_one_that_plans_loses_less():
    scene = random_scene(np.random.default_rng(3))
    view = first_view(scene)
    assert margin(scene, view, scene.motion[0, :3]) > 0.05
    stands, whole, way = lost(scene, np.random.default_rng(0), False)
    plans, _, moved = lost(scene, np.random.default_rng(0), True)
    assert 0.0 < stands < whole
    assert way == 0.0
    assert plans < stands
    assert moved > 0.0
