"""Statics of the six balls: derivatives, the paper's premise, and what cures it."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import TURNS, gaps, tool_pose, turned_by, turns_of
from plants.snake.core import SnakeCoreParams, torques_against_core
from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.statics import Statics
from plants.snake.tension import tensions, torques_against
from plants.snake.weight import weight
from systems.common.parameter import ParameterError

PARAMS = SnakeParams()
WEIGHTLESS = (0.0, 0.0, 0.0)


def statics(kind="elastic", gravity=WEIGHTLESS, **core):
    return Statics(core=SnakeCoreParams(kind=kind, **core), gravity=gravity)


def posture(rng, most=PARAMS.max_bend):
    bends = np.zeros(7)
    bends[1::2] = rng.uniform(-np.pi, np.pi, 3)
    bends[2::2] = most * np.sqrt(rng.uniform(0, 1, 3))
    return posture_of(bends)


def moved(turns, delta):
    out = np.empty_like(turns)
    turned_by(turns, delta, out)
    return out


def anyhow(rng, turns):
    """Balls that turn by some degrees more, each its own way."""
    return moved(turns, rng.normal(scale=0.08, size=TURNS))


def differences(model, turns, **load):
    """Gradient and Hessian of the energy by central differences, 4th order."""

    def at(delta):
        return model.energy(moved(turns, delta), **load)[0]

    unit = np.eye(TURNS)
    stencil = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
    s = 2e-3
    g = np.array([sum(c * at(k * s * u) for k, c in stencil) / s for u in unit])
    H = np.empty((TURNS, TURNS))
    twice = ((-2, -1 / 12), (-1, 4 / 3), (0, -5 / 2), (1, 4 / 3), (2, -1 / 12))
    along = [sum(c * at(k * s * u) for k, c in twice) / s**2 for u in unit]
    for i in range(TURNS):
        H[i, i] = along[i]
        for j in range(i):
            both = unit[i] + unit[j]
            d2 = sum(c * at(k * s * both) for k, c in twice) / s**2
            H[i, j] = H[j, i] = (d2 - along[i] - along[j]) / 2
    return g, H


def is_smooth(model, turns):
    """Whether no wire is about to touch its ball, and no plate another's rim."""
    R, d, stop = (float(model.record[0][name]) for name in ("R", "d", "stop"))
    points = np.column_stack([model.record[0]["points"], np.full(9, d)])
    chords = [
        np.linalg.norm(
            points[3 * (i // 2) :] @ turn.T - points[3 * (i // 2) :] * [1, 1, -1],
            axis=1,
        )
        for i, turn in enumerate(turns)
    ]
    clear = min(np.abs(chord - 2 * d).min() for chord in chords)
    return clear > 0.01 * R and np.arccos(turns[:, 2, 2]).max() < stop - 0.02


def test_derivatives_are_those_of_the_energy():
    """Under tensions and lengths, with weight and a force on the tool."""
    model, compared = statics(gravity=(0.0, 0.0, -9.81)), 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        turns = anyhow(rng, turns_of(posture(rng)))
        if not is_smooth(model, turns):
            continue
        paths = model.energy(turns, np.ones(9))[1].L
        force = rng.normal(size=3)
        for load in (
            {"tension": rng.uniform(1, 9, 9), "force": force},
            {"tension": 0, "wound": paths - rng.uniform(1e-4, 4e-4, 9), "force": force},
        ):
            load["tension"] = load["tension"] * np.ones(9)
            _, to = model.energy(turns, **load)
            g, H = differences(model, turns, **load)
            np.testing.assert_allclose(to.g, g, atol=1e-10)
            np.testing.assert_allclose(to.H, H, atol=1e-9)
            found, numeric = np.linalg.eigvalsh(to.H), np.linalg.eigvalsh(H)
            np.testing.assert_allclose(found, numeric, rtol=1e-6, atol=1e-9)
        compared += 1
    assert compared >= 8


def test_lengths_are_equations_2_and_3_and_the_tool_equation_1():
    rng = np.random.default_rng(1)
    for _ in range(20):
        x = posture(rng)
        _, to = statics().energy(turns_of(x), np.ones(9))
        np.testing.assert_allclose(to.L, wire_lengths(x, PARAMS), atol=1e-16)
        np.testing.assert_allclose(
            tool_pose(turns_of(x), x[0], PARAMS), forward(x, PARAMS), atol=1e-15
        )


def test_the_papers_premise_is_an_unstable_equilibrium_under_wires_alone():
    """-sum(T) d/2 for each split, +sum(T) R^2/(2d) for each ball's torsion."""
    model, straight = statics("none"), turns_of(np.zeros(7))
    for T in (0.5, 2.0, 20.0):
        found = model.equilibrium(straight, [T] * 9)
        assert found.converged and not found.stable and found.iterations == 0
        _, to = model.energy(straight, [T] * 9)
        wires = np.repeat([9, 6, 3], 2) * T
        d, R = PARAMS.face, PARAMS.ball_radius
        wanted = np.concatenate([np.repeat(-wires * d / 2, 2), wires * R**2 / (2 * d)])
        np.testing.assert_allclose(
            np.linalg.eigvalsh(to.H), np.sort(wanted), atol=1e-12
        )
    # Bent, and held by nine stiff drums, it is no better.
    rng = np.random.default_rng(2)
    for _ in range(20):
        x = posture(rng)
        T = tensions(x[1:], np.zeros(6), PARAMS, 2.0)
        _, to = model.energy(
            turns_of(x), np.zeros(9), wire_lengths(x, PARAMS) - T / 2e4
        )
        np.testing.assert_allclose(to.T, T, rtol=1e-9)
        assert np.linalg.eigvalsh(to.H)[5] < 0.0


def test_without_a_core_a_push_buckles_it():
    wound = wire_lengths(np.zeros(7), PARAMS) - 1e-4
    pushed = anyhow(np.random.default_rng(0), turns_of(np.zeros(7)))
    found = statics("none").equilibrium(pushed, wound=wound)
    assert gaps(found.turns)[0].max() > 0.2
    found = statics().equilibrium(pushed, wound=wound)
    assert found.stable
    assert gaps(found.turns)[0].max() < 1e-8


def test_a_core_cures_it_and_pretension_undoes_the_cure():
    """Share of bent postures that stay where their lengths put them."""
    shares = []
    for bend, least in ((0.0, 0.5), (0.04, 0.5), (0.04, 2.0)):
        model, stable = statics(bend=bend, twist=0.775 * bend), 0
        for seed in range(40):
            x = posture(np.random.default_rng(seed))
            _, to = model.energy(turns_of(x), np.zeros(9))
            bent = torques_against_core(x[1:], model.core)
            T = tensions(x[1:], bent, PARAMS, least)
            found = model.equilibrium(turns_of(x), wound=to.L - T / 2e4)
            stable += found.stable and gaps(found.turns)[0].max() < 0.3
        shares.append(stable / 40)
    none, slack, tight = shares
    assert none == 0.0
    assert slack > 0.75 > tight > 0.1


def test_coupled_balls_are_the_papers_model():
    """Tensions that hold the paper's snake leave the geared one where it is."""
    rng = np.random.default_rng(3)
    model = statics("coupled", gravity=(0.0, 0.0, -9.81))
    for _ in range(20):
        x, force = posture(rng), 0.1 * rng.normal(size=3)
        tau = torques_against(x, force, PARAMS) - weight(x, PARAMS, model.drive)[1:]
        wound = wire_lengths(x, PARAMS) - tensions(x[1:], tau, PARAMS) / 2e4
        found = model.equilibrium(turns_of(x), wound=wound, force=force)
        assert found.stable
        p = tool_pose(found.turns, x[0], PARAMS)[:3, 3]
        assert np.linalg.norm(p - forward(x, PARAMS)[:3, 3]) < 5e-6
        split, torsion = gaps(found.turns)
        assert split.max() < 1e-9 and np.abs(torsion).max() < 1e-3


def test_a_moment_turns_the_tool_about_itself():
    """Across the straight robot: by virtual work over the balls in series.

    Straight is where wires begin to touch; the stiffness of either side differs.
    """
    model = statics("coupled")
    wound = wire_lengths(np.zeros(7), PARAMS) - 1e-4
    turns, moment = [], 1e-4
    for m in (-moment, moment):
        found = model.equilibrium(
            turns_of(np.zeros(7)), wound=wound, moment=[m, 0.0, 0.0]
        )
        assert found.stable
        turns.append(found)
    _, to = model.energy(turns_of(np.zeros(7)), np.zeros(9), wound)
    pair = np.kron(np.eye(3), np.vstack([np.eye(3), np.eye(3)]))
    K = pair.T @ to.H @ pair
    about_x = np.tile([2.0, 0.0, 0.0], 3)
    compliance = about_x @ np.linalg.solve(K, about_x)
    angle = [np.arctan2(*tool_pose(f.turns, 0, PARAMS)[2:0:-1, 1]) for f in turns]
    assert angle[1] - angle[0] == pytest.approx(2 * moment * compliance, rel=1e-2)


def test_what_is_no_number_does_not_converge():
    found = statics().equilibrium(turns_of(np.zeros(7)), wound=[np.nan] * 9)
    assert not found.converged and not found.stable


def test_an_unknown_core_is_refused():
    with pytest.raises(ParameterError, match=r"kind='elastik'.*'elastic'"):
        statics("elastik")
