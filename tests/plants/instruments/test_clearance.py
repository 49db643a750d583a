"""Clearances against an independent distance of segments."""

import numpy as np
import pytest
from scipy.optimize import minimize

from plants.instruments.clearance import Capsule, Clearance, add_clearance
from plants.instruments.instrument import InstrumentParams
from plants.instruments.posed_tools import PosedToolsParams
from systems.common.signal import columns

ROBOT, TOOLS = InstrumentParams(), PosedToolsParams()


def core(tip, u, length, radius):
    """Ends of a capsule's inner segment: tip and length are of its surface."""
    tip, u = np.asarray(tip), np.asarray(u) / np.linalg.norm(u)
    return tip - radius * u, tip - (length - radius) * u


def segment_distance(a, b):
    """Least distance of two segments, by brute force over their proportions."""

    def distance(x):
        p = a[0] + x[0] * (a[1] - a[0])
        q = b[0] + x[1] * (b[1] - b[0])
        return np.sum((p - q) ** 2) * 1e4

    starts = [(s, t) for s in (0.1, 0.5, 0.9) for t in (0.1, 0.5, 0.9)]
    best = min(
        minimize(distance, x, bounds=[(0, 1), (0, 1)], tol=1e-14).fun for x in starts
    )
    return np.sqrt(best / 1e4)


@pytest.mark.parametrize("seed", range(4))
def test_clearance_is_the_distance_of_the_shafts_surfaces(make_scene, seed):
    rng = np.random.default_rng(seed)
    shafts = {}
    for name in ("target", "obstacle", "camera"):
        fulcrum = np.array([*rng.uniform(0.03, 0.1, 2) * rng.choice([-1, 1], 2), 0.0])
        tip = np.array([*rng.uniform(-0.05, 0.05, 2), -rng.uniform(0.05, 0.15)])
        u = (tip - fulcrum) / np.linalg.norm(tip - fulcrum)
        shafts[name] = [*tip, *u]
    p_WP = np.array([0.03, -0.02, -0.13])
    scene = make_scene(p_WP=p_WP, tool_shafts=shafts)
    measured = scene.output(scene.clearance, "clearance")

    r = 0.5 * ROBOT.diameter
    robot = core(p_WP, p_WP, ROBOT.length - ROBOT.mount_length, r)
    for value, name in zip(measured, ("obstacle", "target", "camera"), strict=True):
        scope = name == "camera"
        radius = 0.5 * (TOOLS.endoscope_diameter if scope else TOOLS.tool_diameter)
        length = TOOLS.endoscope_length if scope else TOOLS.tool_length
        other = core(shafts[name][:3], shafts[name][3:], length, radius)
        expected = segment_distance(robot, other) - r - radius
        assert value == pytest.approx(expected, abs=2e-5)


def test_clearance_is_the_scene_graphs_signed_distance(make_scene):
    scene = make_scene(p_WP=(0.03, -0.02, -0.13))
    measured = scene.output(scene.clearance, "clearance")
    for value, distance in zip(measured, scene.signed_distances(), strict=True):
        assert value == pytest.approx(distance, abs=2e-5)


SHAFT = Capsule(0, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]), 0.0025)


def test_columns_are_roles_or_names_where_a_role_is_shared():
    dut = Clearance(SHAFT, dict.fromkeys(("obstacle", "target", "camera"), SHAFT))
    assert columns(dut.signals["clearance"]) == ("obstacle", "target", "camera")
    tools = (("near", "obstacle"), ("far", "obstacle"), ("S", "target"))
    dut = Clearance(SHAFT, dict.fromkeys(("near", "far", "S"), SHAFT), tools)
    assert columns(dut.signals["clearance"]) == ("near", "far", "target")


def test_missing_geometry_is_refused():
    with pytest.raises(ValueError, match=r"no geometry of \['camera'\]"):
        Clearance(SHAFT, {"obstacle": SHAFT, "target": SHAFT})
    with pytest.raises(ValueError, match="no geometry of the robot"):
        add_clearance(None, None, None, None, None)
