"""Go to target: equations (1) to (4), geometry, arrival, limits, bad input."""

from dataclasses import replace
from math import nan

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from systems.auto_guidance import go_to_target as module
from systems.auto_guidance.go_to_target import GoToTarget, GoToTargetParams
from systems.common.signal import example, flat
from systems.common.signals import Estimate, Guide, RobotTool
from tests.loosely import loosely

corrected_force = loosely(module.corrected_force, module.constants)
printed_force = loosely(module.printed_force, module.constants)
go_to_target = loosely(module.go_to_target, module.constants)
guide_point = loosely(module.guide_point)
AXES = GoToTargetParams(contact_distance=0.0)
DT = 1.0 / 60.0
ROBOT, OBSTACLE = example(RobotTool), example(Estimate)
TARGET = OBSTACLE._replace(p=(0.05, 0.03, -0.12), fulcrum=(0.1, 0.03, 0.0))
DOWNWARDS = RobotTool((0.0, 0.0, 0.0), (0.0, 0.0, -0.1))


def estimate(p, g=(0.0, 0.1, 0.0), v=(0.0, 0.0, 0.0)):
    return OBSTACLE._replace(p=tuple(p), v=tuple(v), fulcrum=g)


def guide(m_r, m_o, goal, s=1.0, fraction=1.0):
    rho = float(np.linalg.norm(np.subtract(m_r, m_o)))
    return Guide(m_r, m_o, rho, s, fraction, goal)


# The tip 12 mm beside the obstacle, 20 mm from the goal, not in line.
M_R, M_O, GOAL = (0.0, 0.0, -0.1), (0.012, 0.0, -0.1), (0.016, 0.012, -0.1)
DOWN = (0.0, 0.0, -1.0)


def test_guide_point_and_its_target_in_a_scene_worked_out_by_hand():
    # R hangs along -z, O lies along x at z = -0.06, 0.02 in front: they come
    # closest 0.06 below G_R, and 0.05 along O.
    obstacle = estimate((0.05, 0.02, -0.06), g=(-0.05, 0.02, -0.06))
    g = guide_point(DOWNWARDS, obstacle, (0.1, 0.0, -0.1), 0.1)
    np.testing.assert_allclose(g.M_R, (0, 0, -0.06), atol=1e-12)
    np.testing.assert_allclose(g.M_O, (0, 0.02, -0.06), atol=1e-12)
    np.testing.assert_allclose((g.rho, g.s, g.l_over_L), (0.02, 0.6, 0.5))
    np.testing.assert_allclose(g.M_Rf, (0.06, 0, -0.06), atol=1e-12)


def test_guide_point_keeps_off_the_fulcrum():
    # O's shaft comes closest next to G_R.
    obstacle = estimate((0.02, 0.02, -0.1), g=(0.02, 0.0, 0.0))
    g = guide_point(DOWNWARDS, obstacle, (0.1, 0.0, -0.1), 0.2)
    assert g.s == 0.2 and g.rho == pytest.approx(0.02)
    np.testing.assert_allclose(g.M_R, (0, 0, -0.02), atol=1e-12)


def gradient_force(params, m_r, m_o, goal, k):
    """-grad of K_a r^2 + K/2 (1/rho - 1/rho0)^2 r by finite differences."""

    def potential(p):
        rho, r = np.linalg.norm(p - m_o), np.linalg.norm(goal - p)
        gap = 1 / rho - 1 / params.influence_distance
        return params.attraction_gain * r**2 + 0.5 * k * gap**2 * r

    h = 1e-7
    m_r, m_o, goal = map(np.array, (m_r, m_o, goal))
    return -np.array(
        [(potential(m_r + h * e) - potential(m_r - h * e)) / (2 * h) for e in np.eye(3)]
    )


def test_corrected_force_away_from_the_obstacle_is_the_potentials_gradient():
    # Along n_o the unit term has no part: there F is -grad U but for what n_g,
    # the gradient's second direction, adds along n_o.
    # A goal this near is within the distance that r counts in full.
    params = replace(AXES, goal_distance_floor=0.0, max_speed=0.1)
    assert params.slowing_distance > 0.02
    f = np.array(corrected_force(params, guide(M_R, M_O, GOAL), DOWN))
    k = params.repulsion_gain
    expected = gradient_force(params, M_R, M_O, GOAL, k)
    n_o = np.subtract(M_R, M_O) / 0.012
    gap = 1 / 0.012 - 1 / params.influence_distance
    n_g = np.subtract(GOAL, M_R) / np.linalg.norm(np.subtract(GOAL, M_R))
    expected = expected - 0.5 * k * gap**2 * n_g
    assert f @ n_o == pytest.approx(expected @ n_o, rel=1e-6)


def test_escape_term_is_across_and_on_the_goals_side():
    f = np.array(corrected_force(AXES, guide(M_R, M_O, GOAL), DOWN))
    off = np.array(
        corrected_force(replace(AXES, repulsion_gain=0.0), guide(M_R, M_O, GOAL), DOWN)
    )
    n_o = np.subtract(M_R, M_O) / 0.012
    across = (f - off) - ((f - off) @ n_o) * n_o
    gap = 1 / 0.012 - 1 / AXES.influence_distance
    # Of the size the gradient gives it, on the goal's side (y), hardly turned.
    size = 0.5 * AXES.repulsion_gain * gap**2
    assert np.linalg.norm(across) == pytest.approx(size, rel=0.01)
    assert across[1] > 0.99 * np.linalg.norm(across)


def test_escape_term_has_a_side_where_goal_and_obstacle_are_in_line():
    ahead = guide(M_R, M_O, (0.04, 0.0, -0.1))
    f = corrected_force(AXES, ahead, DOWN)
    # R retracts: up the shaft.
    assert f[2] > 0.0 and f[1] == pytest.approx(0.0)


def test_conical_gain():
    base = np.array(
        corrected_force(replace(AXES, repulsion_gain=0), guide(M_R, M_O, GOAL), DOWN)
    )
    whole = np.array(corrected_force(AXES, guide(M_R, M_O, GOAL), DOWN)) - base
    part = guide(M_R, M_O, GOAL, fraction=0.3)
    np.testing.assert_allclose(
        np.array(corrected_force(AXES, part, DOWN)) - base, 0.3 * whole
    )


def test_no_repulsion_from_the_borders_distance_on():
    far = guide((0.0, 0.0, -0.1), (0.0, AXES.influence_distance, -0.1), GOAL)
    f = corrected_force(AXES, far, DOWN)
    pull = 2 * AXES.attraction_gain
    np.testing.assert_allclose(f, (pull * 0.015, pull * 0.012, 0), rtol=0.4)
    assert np.cross(f, np.subtract(GOAL, M_R)) == pytest.approx(0.0)


def test_surface_distance_shifts_the_field():
    surface = replace(AXES, contact_distance=0.005)
    near = guide((0, 0, -0.1), (0.012, 0, -0.1), GOAL)
    nearer = guide((0.005, 0, -0.1), (0.012, 0, -0.1), (0.021, 0.012, -0.1))
    np.testing.assert_allclose(
        corrected_force(surface, near, DOWN), corrected_force(AXES, nearer, DOWN)
    )


def test_printed_force_is_equation_2_to_the_letter():
    params = replace(AXES, form="printed")
    g = guide(M_R, M_O, GOAL, fraction=0.7)
    r = np.subtract(GOAL, M_R)
    rho_hat = np.subtract(M_R, M_O) / 0.012
    n = np.cross(np.cross(r / np.linalg.norm(r), rho_hat), rho_hat)
    gap = 1 / 0.012 - 1 / params.influence_distance
    k = 0.7 * params.repulsion_gain
    expected = 2 * params.attraction_gain * r - k * gap**2 * (r / 0.012**2 + n / 2)
    np.testing.assert_allclose(printed_force(params, g, DOWN), expected)


def test_printed_form_integrates_without_damping_and_saturates():
    params = GoToTargetParams(form="printed")
    target = estimate((0.05, 0.0, -0.1))
    far = estimate((0.0, 0.2, -0.1), g=(0.0, 0.2, 0.0))
    tool = DOWNWARDS._replace(tip=(0.049, 0.0, -0.1))
    v, g = go_to_target(params, (0.01, 0.0, 0.0), DT, tool, far, target)
    assert g.rho > params.influence_distance
    assert v[0] == pytest.approx(0.01 + 2 * params.attraction_gain * 0.001 * DT)
    tool = DOWNWARDS._replace(tip=(-0.05, 0.0, -0.1))
    v, _ = go_to_target(params, (0.01, 0.0, 0.0), DT, tool, far, target)
    assert np.linalg.norm(v) == pytest.approx(params.max_speed)


def follow(params, target_velocity=(0.0, 0.0, 0.0), duration=6.0):
    """Tip errors and commanded velocities of an ideal robot, free of obstacles."""
    far = estimate((0.0, 0.3, -0.1), g=(0.0, 0.3, 0.0))
    g, p, v = np.zeros(3), np.array([-0.05, -0.03, -0.1]), (0.0, 0.0, 0.0)
    errors, velocities = [], []
    for k in range(round(duration / DT)):
        p_s = np.array([0.05, 0.03, -0.12]) + k * DT * np.array(target_velocity)
        target = estimate(p_s, v=target_velocity)
        errors.append(np.linalg.norm(p - p_s))
        v, _ = go_to_target(params, v, DT, RobotTool(tuple(g), tuple(p)), far, target)
        velocities.append(v)
        p = p + DT * np.array(v)
    return np.array(errors), np.array(velocities)


def test_arrives_straight_at_full_speed_and_comes_to_rest():
    params = GoToTargetParams()
    errors, velocities = follow(params)
    speeds = np.linalg.norm(velocities, axis=1)
    assert errors[-1] < 1e-5 and speeds[-1] < 1e-5
    assert np.all(np.diff(errors) < 1e-9)  # never away from the target: no orbit
    cruise = (errors > params.slowing_distance + 1e-3) & (np.arange(len(errors)) > 12)
    np.testing.assert_allclose(speeds[cruise], params.max_speed, rtol=1e-3)
    assert cruise.sum() > 30


def test_printed_form_never_comes_to_rest():
    errors, velocities = follow(GoToTargetParams(form="printed"), duration=20.0)
    speeds = np.linalg.norm(velocities, axis=1)
    assert speeds[-120:].max() > 0.5 * GoToTargetParams().max_speed
    assert errors[-120:].max() > 1e-3


def test_follows_a_drifting_target_without_lag():
    errors, _ = follow(GoToTargetParams(), target_velocity=(0.006, 0.008, 0.0))
    assert errors[-60:].max() < 2e-4


def test_acceleration_is_bounded_even_where_the_guide_point_jumps():
    params = GoToTargetParams()
    rng = np.random.default_rng(5)
    v = (0.0, 0.0, 0.0)
    for _ in range(200):
        tool = DOWNWARDS._replace(tip=(*rng.uniform(-0.05, 0.05, 2), -0.1))
        obstacle = estimate((*rng.uniform(-0.05, 0.05, 2), -0.1), g=(0.01, 0, 0))
        after, _ = go_to_target(
            params, v, DT, tool, obstacle, estimate((0.05, 0.03, -0.12))
        )
        change = np.linalg.norm(np.subtract(after, v))
        assert change <= params.max_acceleration * DT * (1 + 1e-9)
        assert np.linalg.norm(after) <= params.max_speed * (1 + 1e-9)
        v = after


@pytest.mark.parametrize(
    "spoil",
    [
        lambda tool, o, t: (tool, o._replace(known=0.0), t),
        lambda tool, o, t: (tool, o, t._replace(known=0.0)),
        lambda tool, o, t: (tool, Estimate(*[(nan,) * 3] * 4, *[nan] * 5), t),
        lambda tool, o, t: (tool, o, t._replace(v=(nan, 0.0, 0.0))),
        lambda tool, o, t: (RobotTool((nan,) * 3, (nan,) * 3), o, t),
    ],
)
def test_slows_down_to_rest_without_usable_inputs(spoil):
    params = GoToTargetParams()
    inputs = spoil(ROBOT, OBSTACLE, TARGET)
    v = (0.05, 0.0, 0.0)
    speeds = []
    for _ in range(60):
        v, g = go_to_target(params, v, DT, *inputs)
        speeds.append(np.linalg.norm(v))
        assert np.isfinite(flat(g)).all() and len(flat(g)) == 12
    assert speeds[0] > 0.03  # smoothly
    assert np.all(np.diff(speeds) <= 0) and speeds[-1] < 1e-9


def test_block_output_is_the_step_that_its_update_makes():
    dut = GoToTarget()
    context = dut.CreateDefaultContext()
    for port, value in zip(
        ("robot_tool", "obstacles", "target"),
        (ROBOT, OBSTACLE, TARGET),
        strict=True,
    ):
        dut.GetInputPort(port).FixValue(context, flat(value))
    v_tip, expected_guide = go_to_target(
        GoToTargetParams(),
        (0.0, 0.0, 0.0),
        DT,
        ROBOT,
        OBSTACLE,
        TARGET,
    )
    v1 = dut.GetOutputPort("v1").Eval(context)
    np.testing.assert_allclose(v1, expected_guide.s * np.array(v_tip))
    np.testing.assert_allclose(
        dut.GetOutputPort("guide").Eval(context), flat(expected_guide)
    )
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.5 * DT)
    state = context.get_discrete_state_vector().value()
    np.testing.assert_allclose(state, [*v_tip, 0.0])
    # Between two updates the step is half as long.
    half, g = go_to_target(
        GoToTargetParams(),
        v_tip,
        0.5 * DT,
        ROBOT,
        OBSTACLE,
        TARGET,
    )
    np.testing.assert_allclose(
        dut.GetOutputPort("v1").Eval(context), g.s * np.array(half)
    )


@pytest.mark.parametrize(
    "change, message",
    [
        (
            {"form": "correct"},
            "form='correct': expected one of .*did you mean 'corrected'",
        ),
        ({"attraction_gain": -1.0}, r"go_to_target.attraction_gain=-1.0 1/s\^2: .*> 0"),
        ({"attraction_gain": 1e9}, r"expected > 0 and <= 10000; the default is 120"),
        ({"repulsion_gain": -1e-4}, "repulsion_gain=-0.0001"),
        ({"max_speed": 0.0}, "max_speed=0.0"),
        ({"max_acceleration": nan}, "max_acceleration=nan"),
        ({"damping": 0.0}, "damping=0.0"),
        ({"period": -0.1}, "period=-0.1"),
        ({"influence_distance": float("inf")}, "influence_distance=inf"),
        ({"contact_distance": -0.001}, "contact_distance=-0.001"),
        ({"proportion_floor": 0.0}, "proportion_floor=0.0: expected > 0 and <= 1"),
    ],
)
def test_bad_parameters(change, message):
    with pytest.raises(ValueError, match=message):
        GoToTarget(GoToTargetParams(**change))
