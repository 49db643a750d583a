"""The fuzzy arbiter: Table I cell by cell, axes, weights, equation (6), bad input."""

from math import cos, nan, pi, sin

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest
import skfuzzy

from systems.auto_guidance import fuzzy_arbiter as module
from systems.auto_guidance.fuzzy_arbiter import (
    DECISIONS,
    DISTANCES,
    TABLE_I,
    WEIGHT_TABLE,
    WEIGHTS,
    FuzzyArbiter,
    FuzzyArbiterParams,
    Weights,
)
from systems.common.signal import example, flat
from systems.common.signals import Estimate, Guide, RobotTool
from tests.loosely import loosely

arbitrate = loosely(module.arbitrate, module.constants)
axes = loosely(module.axes)
commanded_velocity = loosely(module.commanded_velocity, module.constants)
decision = loosely(module.decision, module.constants)
decision_labels = loosely(module.decision_labels, module.constants)
label_weights = loosely(module.label_weights, module.constants)
quadrants = loosely(module.quadrants)
PARAMS = FuzzyArbiterParams()
GUIDE, ROBOT, OBSTACLE = example(Guide), example(RobotTool), example(Estimate)
TARGET = OBSTACLE._replace(p=(0.05, 0.03, -0.12), fulcrum=(0.1, 0.03, 0.0))
NONE = Weights(0.0, 0.0, 0.0)
DT = 1.0 / 60.0

# Table I as the paper prints it: v_R across, v_O down.
PAPER = [
    ["A", "FA", "HC", "C"],
    ["FA", "A", "C", "HC"],
    ["HC", "C", "A", "FA"],
    ["C", "HC", "FA", "A"],
]


def direction(quadrant, speed=0.05):
    angle = pi / 4 + (quadrant - 1) * pi / 2
    return speed * cos(angle), speed * sin(angle)


@pytest.mark.parametrize("row", range(4))
@pytest.mark.parametrize("column", range(4))
def test_each_cell_of_table_i(row, column):
    degrees = decision_labels(PARAMS, direction(column + 1), direction(row + 1))
    expected = [float(PAPER[row][column] == label) for label in DECISIONS]
    assert degrees == pytest.approx(expected)


def test_the_axes_reading_fits_the_paper():
    # FA: the quadrants differ in x only, C: in y only, HC: in both, A: in none.
    for row in range(4):
        for column in range(4):
            o, r = np.sign(direction(row + 1)), np.sign(direction(column + 1))
            label = {(0, 0): "A", (1, 0): "FA", (0, 1): "C", (1, 1): "HC"}[
                tuple(int(k) for k in o != r)
            ]
            assert PAPER[row][column] == label == TABLE_I[row][column]


def test_quadrants_sum_to_one_and_fade_without_speed():
    for angle in np.linspace(0, 2 * pi, 37):
        mu = quadrants(0.05 * cos(angle), 0.05 * sin(angle), 0.01)
        assert sum(mu) == pytest.approx(1.0)
        # cos^2 of the angle to each diagonal, within 90 degrees.
        for k in range(4):
            off = cos(angle - pi / 4 - k * pi / 2)
            assert mu[k] == pytest.approx(max(0.0, off) ** 2)
    assert quadrants(0.0, 0.0, 0.01).tolist() == [1.0] * 4
    slow = quadrants(*direction(1, 0.004), 0.01)
    assert slow == pytest.approx([1.0, 0.6, 0.6, 0.6])


def test_labels_are_scikit_fuzzys_minimum_and_maximum():
    rng = np.random.default_rng(6)
    for _ in range(20):
        v_r, v_o = rng.uniform(-0.05, 0.05, (2, 2))
        fired = np.minimum.outer(
            quadrants(*v_o, PARAMS.moving_speed), quadrants(*v_r, PARAMS.moving_speed)
        )
        cells = np.array(PAPER)
        expected = [fired[cells == label].max() for label in DECISIONS]
        assert decision_labels(PARAMS, tuple(v_r), tuple(v_o)) == pytest.approx(
            expected
        )


@pytest.mark.parametrize("i", range(4))
@pytest.mark.parametrize("j", range(3))
def test_each_cell_of_the_weights(i, j):
    labels = [float(k == i) for k in range(4)]
    got = label_weights(PARAMS, labels, PARAMS.distances[j])
    assert got == pytest.approx(WEIGHTS[WEIGHT_TABLE[i][j]])


def test_weights_between_the_cells_are_scikit_fuzzys_inference():
    # Narrow output sets of equal width, one centroid for each weight.
    universe = np.linspace(-0.1, 1.1, 12001)
    rng = np.random.default_rng(8)
    near = (0.0, *PARAMS.distances, 1.0)
    for _ in range(10):
        labels = rng.uniform(size=4).tolist()
        distance = rng.uniform(PARAMS.distances[0], PARAMS.distances[2])
        mu = [
            float(skfuzzy.trimf(np.array([distance]), near[k : k + 3])[0])
            for k in range(3)
        ]
        degree = dict.fromkeys(WEIGHTS, 0.0)
        for i in range(4):
            for j in range(len(DISTANCES)):
                cell = WEIGHT_TABLE[i][j]
                degree[cell] = max(degree[cell], min(labels[i], mu[j]))
        # The conclusions differ in c_2 + c_3: 0, 1 and 2, scaled to [0, 1].
        fired = np.zeros_like(universe)
        for cell, value in WEIGHTS.items():
            c = 0.5 * (value[1] + value[2])
            output = skfuzzy.trapmf(universe, (c - 5e-4, c - 5e-4, c + 5e-4, c + 5e-4))
            fired = np.fmax(fired, np.fmin(degree[cell], output))
        expected = 2.0 * skfuzzy.defuzz(universe, fired, "centroid")
        _, c2, c3 = label_weights(PARAMS, labels, distance)
        assert c2 + c3 == pytest.approx(expected, abs=2e-3)


def test_axes_point_to_the_obstacle_and_to_the_goals_side():
    guide = Guide((0, 0, -0.1), (0, 0.02, -0.1), 0.02, 1, 1, (0.05, 0.01, -0.1))
    x, y = axes(guide)
    np.testing.assert_allclose((x, y), ((1, 0, 0), (0, 1, 0)), atol=1e-12)
    # The goal straight behind the obstacle, and tools whose axes touch.
    for odd in (guide._replace(M_Rf=(0, 0.05, -0.1)), guide._replace(M_O=guide.M_R)):
        x, y = map(np.array, axes(odd))
        assert abs(x @ y) < 1e-12
        assert np.linalg.norm(x) == pytest.approx(1) == np.linalg.norm(y)


def meeting(v_o, rho=0.012):
    """The tip at G_R's proportion 1, O's tip `rho` off along y, the goal along x."""
    p_o = (0, rho, -0.1)
    guide = Guide((0, 0, -0.1), p_o, rho, 1, 1, (0.05, 0, -0.1))
    return guide, OBSTACLE._replace(p=p_o, v=v_o, fulcrum=(0, 0.1, 0))


def test_opposed_velocities_bring_in_corrections_and_retreat():
    v1 = (0.03, 0.03, 0.0)  # to the goal, and to O
    guide, obstacle = meeting((0.0, -0.03, -0.0))
    c1, c2, c3 = decision(PARAMS, v1, guide, obstacle)
    assert c1 == 1.0 and c2 > 0.5 and c3 > 0.5
    guide, obstacle = meeting((0.0, -0.03, 0.0), rho=0.03)
    c1, c2, c3 = decision(PARAMS, v1, guide, obstacle)
    assert c2 > 0.5 and c3 < 0.1  # near, not close
    guide, obstacle = meeting((0.0, -0.03, 0.0), rho=0.06)
    assert decision(PARAMS, v1, guide, obstacle) == (1.0, 0.0, 0.0)


def test_same_direction_is_left_to_the_field():
    guide, obstacle = meeting((0.02, -0.03, 0.0))
    assert decision(PARAMS, (0.02, -0.03, 0.0), guide, obstacle) == pytest.approx(
        [1, 0, 0]
    )


def test_the_gated_table_tells_parting_from_closing():
    literal = FuzzyArbiterParams(table="literal")
    v1, v_o = (0.02, 0.03, 0.0), (0.0, -0.03, 0.0)
    closing = meeting(v_o)
    parting = meeting((0.0, 0.03, 0.0))
    back = (0.02, -0.03, 0.0)
    assert decision(PARAMS, v1, *closing) == pytest.approx(
        decision(literal, v1, *closing)
    )
    assert decision(literal, back, *parting)[2] > 0.3
    assert decision(PARAMS, back, *parting) == (1.0, 0.0, 0.0)


def test_figure_4_reads_the_current_velocity_and_the_default_the_wanted_one():
    """A robot that gives way to O still wants to go through it."""
    guide, obstacle = meeting((0.0, -0.03, 0.0))
    zero = (0.0, 0.0, 0.0)
    behaviours = ((0.0, 0.03, 0.0), zero, (0.0, -0.03, 0.0))
    giving_way = (0.0, -0.03, 0.0)
    c3 = {}
    for velocity in ("v_1", "v_R"):
        params = FuzzyArbiterParams(table="literal", velocity=velocity)
        weights, _, _ = arbitrate(
            params, giving_way, DT, behaviours, guide, ROBOT, obstacle, TARGET
        )
        c3[velocity] = weights.c3
    assert c3["v_1"] > 0.5
    assert c3["v_R"] == 0.0  # A, "go away": the field alone, and back it turns


@pytest.mark.parametrize("speed", [0.0, 0.004])
def test_a_standing_or_trembling_obstacle_is_left_to_the_field(speed):
    guide, obstacle = meeting((0.0, -speed, 0.0))
    assert decision(PARAMS, (0.02, 0.03, 0.0), guide, obstacle) == (1.0, 0.0, 0.0)


def test_equation_6():
    velocities = [(0.01, 0.02, 0.0), (-0.004, 0.0, 0.0), (0.0, -0.02, 0.01)]
    weights = Weights(1.0, 0.5, 0.25)
    v_tip = commanded_velocity(
        FuzzyArbiterParams(max_acceleration=10.0),
        (0, 0, 0),
        DT,
        weights,
        velocities,
        0.5,
    )
    v_r = np.array(weights) @ np.array(velocities)
    np.testing.assert_allclose(v_tip, v_r / 0.5)


def test_speed_and_acceleration_are_bounded():
    fast = [(0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    v = (0.0, 0.0, 0.0)
    for k in range(10):
        v = commanded_velocity(PARAMS, v, DT, Weights(1, 0, 0), fast, 1.0)
        expected = min(PARAMS.max_speed, (k + 1) * DT * PARAMS.max_acceleration)
        assert v[0] == pytest.approx(expected)


@pytest.mark.parametrize("lost", ["obstacle", "target", "nan v1", "nan guide", "nan O"])
def test_comes_to_rest_smoothly_when_something_is_not_known(lost):
    v1 = (nan, 0.0, 0.0) if lost == "nan v1" else (0.05, 0.0, 0.0)
    guide, obstacle, target = GUIDE, OBSTACLE, TARGET
    if lost == "nan guide":
        guide = guide._replace(s=nan)
    elif lost == "nan O":
        obstacle = Estimate(*[(nan,) * 3] * 4, *[nan] * 5)
    elif lost == "obstacle":
        obstacle = obstacle._replace(known=0.0)
    elif lost == "target":
        target = target._replace(known=0.0)
    zero = (0.0, 0.0, 0.0)
    v = (0.05, 0.02, 0.0)
    speeds = []
    for _ in range(8):
        weights, v, s = arbitrate(
            PARAMS,
            v,
            DT,
            (v1, zero, zero),
            guide,
            ROBOT,
            obstacle,
            target,
        )
        speeds.append(np.linalg.norm(v))
        assert weights == NONE and np.isfinite(s)
    start = np.hypot(0.05, 0.02)
    expected = [max(0.0, start - (k + 1) * DT) for k in range(8)]
    np.testing.assert_allclose(speeds, expected, atol=1e-12)


def fixed(dut):
    context = dut.CreateDefaultContext()
    for name, value in {
        "v1": (0.05, 0.0, 0.0),
        "v2": (-0.01, 0.0, 0.0),
        "v3": (0.0, -0.01, 0.0),
        "guide": flat(GUIDE),
        "robot_tool": flat(ROBOT),
        "obstacles": flat(OBSTACLE),
        "target": flat(TARGET),
    }.items():
        dut.GetInputPort(name).FixValue(context, value)
    return context


def test_block_output_is_the_step_that_its_update_makes():
    dut = FuzzyArbiter()
    context = fixed(dut)
    weights, v_tip, s = arbitrate(
        PARAMS,
        (0.0, 0.0, 0.0),
        DT,
        ((0.05, 0, 0), (-0.01, 0, 0), (0, -0.01, 0)),
        GUIDE,
        ROBOT,
        OBSTACLE,
        TARGET,
    )
    np.testing.assert_allclose(dut.GetOutputPort("weights").Eval(context), weights)
    np.testing.assert_allclose(
        dut.GetOutputPort("v_R").Eval(context), s * np.array(v_tip)
    )
    Simulator(dut, context).AdvanceTo(0.5 * DT)
    np.testing.assert_allclose(
        context.get_discrete_state_vector().value(), [*v_tip, 0.0]
    )


@pytest.mark.parametrize(
    "change, message",
    [
        ({"table": "printed"}, "table='printed': expected one of literal, gated"),
        ({"velocity": "v_O"}, "velocity='v_O': expected one of v_1, v_R"),
        (
            {"distances": [0.01, 0.02]},
            r"distances=\[0.01, 0.02\] m: expected 3 numbers",
        ),
        ({"distances": [0.03, 0.02, 0.05]}, "distances=.*increasing numbers"),
        (
            {"max_speed": 0.0},
            "fuzzy_arbiter.max_speed=0.0 m/s: expected > 0 and <= 0.5",
        ),
        ({"max_speed": 60.0}, "max_speed=60.0 m/s"),
        ({"max_acceleration": -1.0}, "max_acceleration=-1.0"),
        ({"closing_speed": nan}, "closing_speed=nan"),
        ({"contact_distance": -1.0}, "contact_distance=-1.0"),
    ],
)
def test_bad_parameters(change, message):
    with pytest.raises(ValueError, match=message):
        FuzzyArbiter(FuzzyArbiterParams(**change))
