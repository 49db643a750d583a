"""The formula of the wall's force, and its block's ports."""

import numpy as np
import pytest

from plants.abdomen.wall_force import WallForce, lateral_force


def test_force_is_k_times_the_offset_across_the_shaft():
    u = np.array([0.6, 0.0, -0.8])
    across, along = np.array([0.8, 0.0, 0.6]), 0.02 * u
    p = 0.003 * across + along
    v = 0.01 * across - 0.1 * u
    force, error = lateral_force(tuple(p), tuple(u), tuple(v), 500.0, 5.0)
    assert error == pytest.approx(0.003)
    np.testing.assert_allclose(force, (500.0 * 0.003 + 5.0 * 0.01) * across)


def test_shaft_through_the_fulcrum_feels_nothing():
    force, error = lateral_force(
        (0.0, 0.0, 0.03), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 500.0, 5.0
    )
    assert error == pytest.approx(0.0)
    np.testing.assert_allclose(force, 0.0, atol=1e-15)


def test_ports_are_documented_and_read_the_plant(make_scene):
    for name in ("state", "force", "fulcrum_error"):
        assert f"``{name}``" in WallForce.__doc__
    scene = make_scene()
    np.testing.assert_allclose(scene.output(scene.wall_force, "force"), 0.0, atol=1e-6)
    assert scene.output(scene.wall_force, "fulcrum_error")[0] < 1e-5
