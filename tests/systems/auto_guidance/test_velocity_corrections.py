"""Velocity corrections: Table II cell by cell, crossings, bad input."""

from math import nan

import numpy as np
import pytest
import skfuzzy

from systems.auto_guidance import velocity_corrections as module
from systems.auto_guidance.velocity_corrections import (
    DISTANCES,
    SPEEDS,
    TABLE_II,
    TIMES,
    VelocityCorrections,
    VelocityCorrectionsParams,
)
from systems.common import geometry
from systems.common.signal import example, flat
from systems.common.signals import Estimate, Guide
from tests.loosely import loosely

closest_on_segment = loosely(geometry.closest_on_segment)
crossing = loosely(module.crossing, module.constants)
predicted_tip = loosely(module.predicted_tip)
speed_scale = loosely(module.speed_scale, module.constants)
velocity_correction = loosely(module.velocity_correction, module.constants)
PARAMS = VelocityCorrectionsParams()

# Table II as the paper prints it: distance across, time down.
PAPER = """
     Z  AZ M  F  VF
Z    S  SM NM MM MM
AZ   S  SM NM MM MM
M    SM SM NM FM MM
L    AS AS SM NM MM
VL   AS AS AS SM FM
"""
HEAD, *ROWS = [line.split() for line in PAPER.strip().splitlines()]


def obstacle(p, v, g=(0.0, 0.1, 0.0), a=(0.0, 0.0, 0.0)):
    return example(Estimate)._replace(p=tuple(p), v=tuple(v), a=a, fulcrum=g)


def guide(m_r, goal):
    return Guide(tuple(m_r), (0.0, 0.0, -0.05), 0.05, 1.0, 0.9, tuple(goal))


def test_labels_are_the_papers():
    assert HEAD == DISTANCES
    assert [row[0] for row in ROWS] == TIMES
    assert [row[1:] for row in ROWS] == TABLE_II


@pytest.mark.parametrize("i", range(5))
@pytest.mark.parametrize("j", range(5))
def test_each_cell_gives_its_speed(i, j):
    scales = dict(zip(SPEEDS, PARAMS.scales, strict=True))
    expected = scales[ROWS[i][1 + j]]
    assert speed_scale(PARAMS, PARAMS.distances[j], PARAMS.times[i]) == pytest.approx(
        expected
    )


def test_stop_and_max_movement_are_the_papers():
    scales = dict(zip(SPEEDS, PARAMS.scales, strict=True))
    assert scales["S"] == 0.0 and scales["MM"] == 1.0  # v_2 = -v_1, and 0
    assert PARAMS.scales == sorted(PARAMS.scales)


def test_between_the_cells_it_is_scikit_fuzzys_inference():
    rng = np.random.default_rng(2)
    universe = np.linspace(-0.1, 1.1, 12001)
    scales = dict(zip(SPEEDS, PARAMS.scales, strict=True))

    def degrees(centers, x):
        ends = [-10.0, *centers, 10.0]
        corners = [(ends[k], ends[k + 1], ends[k + 1], ends[k + 2]) for k in range(5)]
        grid = np.array([x])
        return [float(skfuzzy.trapmf(grid, c)[0]) for c in corners]

    for _ in range(10):
        distance, time = rng.uniform(0.0, 0.08), rng.uniform(0.0, 2.0)
        fired = np.zeros_like(universe)
        for row, cells in zip(degrees(PARAMS.times, time), TABLE_II, strict=True):
            for column, label in zip(
                degrees(PARAMS.distances, distance), cells, strict=True
            ):
                c = scales[label]
                corners = (c - 5e-4, c - 5e-4, c + 5e-4, c + 5e-4)
                output = skfuzzy.trapmf(universe, corners)
                fired = np.fmax(fired, np.fmin(min(row, column), output))
        expected = skfuzzy.defuzz(universe, fired, "centroid")
        assert speed_scale(PARAMS, distance, time) == pytest.approx(expected, abs=1e-3)


def test_crossing_against_brute_force():
    """From where on is the way near the shaft at any time, and at which time?"""
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(60):
        m_r = np.array([-0.05, 0.0, -0.09]) + rng.uniform(-0.01, 0.01, 3)
        v1 = np.array([0.06, 0.0, 0.0]) + rng.uniform(-0.03, 0.03, 3)
        e = v1 / np.linalg.norm(v1)
        v_o = (-0.04, *rng.uniform(-0.03, 0.03, 2))
        o = obstacle((0.02, rng.uniform(-0.05, -0.02), -0.12), v_o)
        distance, time, degree = crossing(guide(m_r, m_r + 0.12 * e), v1, o, PARAMS)
        if degree < 0.99:
            continue
        found += 1
        # The tip goes straight from here to its predicted place.
        end = np.array(predicted_tip(o, PARAMS.horizon, PARAMS.acceleration_time))
        times = np.linspace(0.0, PARAMS.horizon, 201)
        start = np.array(o.p)
        tips = [start + t / PARAMS.horizon * (end - start) for t in times]

        def nearest(d, m_r=m_r, e=e, g=o.fulcrum, tips=tips):
            gaps = [closest_on_segment(m_r + d * e, g, tip)[1] for tip in tips]
            return min(gaps), int(np.argmin(gaps))

        gap, k = nearest(distance)
        assert gap < PARAMS.near_distance + 1e-3
        assert times[k] == pytest.approx(time, abs=0.06)
        if distance > 3e-3:  # not yet a little before, or O's shaft is not there
            assert nearest(distance - 3e-3)[0] > gap - 1e-6
    assert found > 15


def test_correction_keeps_the_tables_share_of_v1():
    # O's tip is below the way and 60 mm ahead, its shaft crosses it sideways.
    m_r, v1 = (-0.05, 0.0, -0.1), (0.05, 0.0, 0.0)
    o = obstacle((0.01, -0.03, -0.12), (-0.05, 0.0, 0.01))
    g = guide(m_r, (0.05, 0.0, -0.1))
    distance, time, degree = crossing(g, v1, o, PARAMS)
    assert degree > 0.8 and 0.02 < distance < 0.04 and 0.5 < time < 0.9
    v2 = velocity_correction(PARAMS, v1, g, o)
    cut = degree * (1 - speed_scale(PARAMS, distance, time))
    assert cut > 0.2
    np.testing.assert_allclose(v2, [-cut * 0.05, 0, 0])


def test_head_on_the_way_lies_in_the_sweep():
    # O comes straight at the robot: its shaft is at M_R after 60 mm.
    g = guide((-0.05, 0.0, -0.1), (0.05, 0.0, -0.1))
    o = obstacle((0.01, 0.0, -0.12), (-0.06, 0.0, 0.0), g=(0.01, 0.0, 0.0))
    distance, time, degree = crossing(g, (0.05, 0.0, 0.0), o, PARAMS)
    # At M_R's height the shaft moves at 5/6 of the tip's speed.
    assert distance == pytest.approx(0.0) and degree == 1.0
    assert time == pytest.approx(0.06 / (0.06 * 0.1 / 0.12))


def test_no_steps_where_a_crossing_comes_into_being():
    # O's tip is moved step by step from a clear miss to a clear crossing.
    g, v1 = guide((-0.05, 0.0, -0.1), (0.05, 0.0, -0.1)), (0.05, 0.0, 0.0)
    cuts = [
        velocity_correction(
            PARAMS, v1, g, obstacle((0.01, y, -0.12), (-0.05, 0.0, 0.01))
        )[0]
        for y in np.linspace(0.06, -0.03, 361)
    ]
    assert cuts[0] == 0.0 and cuts[-1] < -0.01
    assert np.abs(np.diff(cuts)).max() < 0.05 * 0.05


def test_acceleration_dies_out_in_the_prediction():
    o = obstacle((0, 0, -0.1), (0.02, 0, 0), a=(0.1, 0, 0))
    # Soon it counts in full, later it has added a tau to the velocity.
    assert predicted_tip(o, 1e-3, 0.2)[0] == pytest.approx(2e-5 + 0.5e-7, rel=1e-4)
    late = predicted_tip(o, 3.0, 0.2)[0] - predicted_tip(o, 2.0, 0.2)[0]
    assert late == pytest.approx(0.02 + 0.1 * 0.2, rel=1e-3)


AHEAD, OBSTACLE = guide((0, 0, -0.1), (0.1, 0, -0.1)), example(Estimate)


@pytest.mark.parametrize(
    "v1, g, o",
    [
        ((nan, 0, 0), AHEAD, OBSTACLE),
        ((0.05, 0, 0), AHEAD._replace(M_Rf=(nan, 0, 0)), OBSTACLE),
        ((0.05, 0, 0), AHEAD, Estimate(*[(nan,) * 3] * 4, *[nan] * 5)),
        ((0.05, 0, 0), AHEAD, OBSTACLE._replace(known=0.0, age=1.0)),
    ],
)
def test_nothing_known_nothing_corrected(v1, g, o):
    assert velocity_correction(PARAMS, v1, g, o) == (0.0, 0.0, 0.0)


def test_block():
    dut = VelocityCorrections()
    context = dut.CreateDefaultContext()
    g = guide((-0.05, 0.0, -0.1), (0.05, 0.0, -0.1))
    o = obstacle((0.01, -0.03, -0.12), (-0.05, 0.0, 0.01))
    for name, value in (
        ("v1", (0.05, 0, 0)),
        ("guide", flat(g)),
        ("obstacles", flat(o)),
    ):
        dut.GetInputPort(name).FixValue(context, value)
    expected = velocity_correction(PARAMS, (0.05, 0, 0), g, o)
    np.testing.assert_allclose(dut.GetOutputPort("v2").Eval(context), expected)
    assert expected[0] < 0.0


@pytest.fixture(scope="module")
def block():
    dut = VelocityCorrections()
    return dut, dut.CreateDefaultContext()


@pytest.mark.parametrize("i", range(5))
@pytest.mark.parametrize("j", range(5))
def test_the_block_keeps_each_cells_share_in_full(block, i, j):
    """O's shaft swings through the way, 0 to 80 mm ahead and in 0 to 2 s."""
    dut, context = block
    distance, time = PARAMS.distances[j], PARAMS.times[i]
    # The way is near the plane of the swing from `near_distance` before it on.
    x, speed = distance + PARAMS.near_distance, 0.02
    tip, v_O = (x, -speed * max(time, 1e-6), -0.12), (0.0, speed, 0.0)
    values = {
        "v1": (0.05, 0.0, 0.0),
        "guide": flat(guide((0.0, 0.0, -0.1), (0.15, 0.0, -0.1))),
        "obstacles": flat(obstacle(tip, v_O, g=(x, 0.0, 0.0))),
    }
    for name, value in values.items():
        dut.GetInputPort(name).FixValue(context, value)
    kept = 1.0 + dut.GetOutputPort("v2").Eval(context)[0] / 0.05
    scales = dict(zip(SPEEDS, PARAMS.scales, strict=True))
    assert kept == pytest.approx(scales[ROWS[i][1 + j]], abs=1e-3)


@pytest.mark.parametrize(
    "change, message",
    [
        (
            {"distances": [0.0, 0.1]},
            r"distances=\[0.0, 0.1\] m: expected 5 numbers >= 0",
        ),
        ({"times": [0, 1, 1, 2, 3]}, "times=.* s: expected increasing numbers"),
        ({"times": [-1, 0, 1, 2, 3]}, "times=.*5 numbers >= 0"),
        ({"distances": [0.0, nan, 0.1, 0.2, 0.3]}, "distances=.*5 numbers"),
        ({"scales": [0.1, 0.2, 0.3, 0.4, 0.5, 1.0]}, "scales=.*0 at the start and 1"),
        ({"horizon": 0.0}, "horizon=0.0 s: expected > 0"),
        ({"horizon": 2.5}, "horizon=2.5 s: expected >= 1.5 times the last of times"),
        ({"near_distance": 5.0}, "near_distance=5.0 m: expected > 0 and <= 0.1"),
        ({"moving_speed": -1.0}, "moving_speed=-1.0"),
    ],
)
def test_bad_parameters(change, message):
    with pytest.raises(ValueError, match=message):
        VelocityCorrections(VelocityCorrectionsParams(**change))
