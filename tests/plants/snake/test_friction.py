"""Friction of wires and sockets: what a step must do, whatever the coefficients."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import TURNS, turned_by, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.friction import SnakeFrictionParams, turning
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.statics import Statics
from plants.snake.statics_kernels import assembled, empty_forces

PARAMS = SnakeParams()
MU = 0.1
CYCLE = 80
SLACKER = 5e-5
"""By which wires are wound shorter than their paths, in m: 1 N."""


def statics(wire=MU, socket=MU, core=None, **friction):
    return Statics(core=core, friction=SnakeFrictionParams(wire, socket, **friction))


def bent(beta, alpha=0.7):
    """Module 1 by beta a ball, the others by a half and a third, elsewhere."""
    return posture_of([0, alpha, beta, alpha - 2, beta / 2, alpha + 2, beta / 3])


def driven(model, betas, force=(0.0, 0.0, 0.0)):
    """The equilibria along a way of bends."""
    found, turns, grip = [], turns_of(bent(betas[0])), None
    for beta in betas:
        wound = wire_lengths(bent(beta), PARAMS) - SLACKER
        step = model.equilibrium(turns, wound=wound, force=force, grip=grip)
        assert step.converged and not step.buckled
        turns, grip = step.turns, step.grip
        found.append(step)
    return found


def there_and_back(cycles, most=0.4):
    """Bends from 0 to `most`, then down to -`most` and up again."""
    up = np.linspace(0, most, 20, endpoint=False)
    down = most * np.cos(np.linspace(0, 2 * np.pi, CYCLE, endpoint=False))
    return np.concatenate([up, np.tile(down, cycles), [most]])


@pytest.fixture(scope="module")
def loop():
    """Three cycles."""
    betas = there_and_back(3)
    return betas, driven(statics(), betas)


def test_what_does_not_change_moves_nothing(loop):
    _, found = loop
    last, model = found[-1], statics()
    wound = last.L - last.T / model.drive.wire_stiffness
    for _ in range(5):
        again = model.equilibrium(last.turns, wound=wound, grip=last.grip)
        np.testing.assert_allclose(again.turns, last.turns, atol=1e-7)
        np.testing.assert_allclose(again.T, last.T, atol=1e-4)
        assert again.heat < 1e-8


def test_a_loop_closes_and_has_a_width(loop):
    betas, found = loop
    turns, n = np.array([step.turns for step in found]), CYCLE
    second, third = turns[20 + n : 20 + 2 * n], turns[20 + 2 * n : 20 + 3 * n]
    np.testing.assert_allclose(third, second, atol=1e-4)
    down, up = n // 4, 3 * n // 4
    assert abs(betas[20 + down] - betas[20 + up]) < 1e-9
    assert np.abs(third[down] - third[up]).max() > 0.01


def test_work_of_the_drums_becomes_heat_and_none_is_gained(loop):
    """Around a closed loop what the drums put in, friction takes."""
    betas, found = loop
    assert min(step.heat for step in found) >= 0.0
    T = np.array([step.T for step in found[-CYCLE - 1 :]])
    x = np.array([bent(beta) for beta in betas[-CYCLE - 1 :]])
    wound = wire_lengths(x, PARAMS)
    work = -((T[1:] + T[:-1]) / 2 * np.diff(wound, axis=0)).sum()
    heat = sum(step.heat for step in found[-CYCLE:])
    assert heat == pytest.approx(work, rel=0.05)


def test_without_friction_a_step_is_an_equilibrium():
    betas = np.linspace(0.0, 0.4, 21)
    smooth = driven(Statics(), betas)[-1]
    assert smooth.heat == 0.0
    np.testing.assert_array_equal(smooth.P[5, 6:], smooth.T[6:])
    errors = []
    for mu in (0.02, 0.002):
        rough = driven(statics(mu, mu), betas)[-1]
        errors.append(np.abs(rough.turns - smooth.turns).max())
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.1)


def test_a_wire_over_a_fixed_arc_is_a_capstan():
    """T at the tip is that at the drum times exp(-mu theta), theta over all balls."""
    model = statics(0.15, 0.0, SnakeCoreParams(bend=10.0, twist=10.0), give=1e-7)
    record = model.record[0]
    x = bent(0.4)
    turns, grip = turns_of(x), None
    for T in (0.5, 3.0):
        held = model.equilibrium(turns, tension=[T] * 9, grip=grip)
        turns, grip = held.turns, held.grip
    for w in range(9):
        count = 2 * (w // 3 + 1)
        theta = np.array([turning(turns[i], w, record) for i in range(count)])
        half = np.tanh(0.15 * theta / 2)
        before = held.P[:count, w] * (1 + half)
        after = held.P[:count, w] * (1 - half)
        np.testing.assert_allclose(before[1:], after[:-1], rtol=1e-5)
        assert before[0] == pytest.approx(3.0, rel=1e-5)
        assert after[-1] == pytest.approx(3.0 * np.exp(-0.15 * theta.sum()), rel=1e-5)


def test_a_wire_turns_by_the_bend_in_its_plane_and_by_more_beside_it():
    record = statics().record[0]
    rng = np.random.default_rng(0)
    shares = []
    for beta in rng.uniform(0.05, PARAMS.max_bend, 100):
        turns = turns_of(posture_of([0, rng.uniform(0, 2 * np.pi), beta, 0, 0, 0, 0]))
        shares.append([turning(turns[0], w, record) / beta for w in range(9)])
    assert np.min(shares) == pytest.approx(1.0, abs=1e-6)
    assert 1.4 < np.max(shares) < 1.6
    inside = turns_of(posture_of([0, 0.0, 0.3, 0, 0, 0, 0]))[0]
    assert turning(inside, 0, record) == pytest.approx(0.3, abs=1e-9)


def test_derivatives_are_those_of_a_steps_energy():
    model = statics()
    found = driven(model, [0.2, 0.21])[-1]
    wound, load = wire_lengths(bent(0.22), PARAMS) - SLACKER, np.zeros(6)
    for seed in range(4):
        off = np.random.default_rng(seed).normal(scale=3e-3, size=TURNS)
        at = np.empty_like(found.turns)
        turned_by(found.turns, off, at)

        def energy(delta, to, at=at):
            turns = np.empty_like(at)
            turned_by(at, delta, turns)
            args = (np.zeros(9), 2e4, wound, load, model.record[0], found.grip)
            return assembled(turns, *args, to)

        to, other, h = empty_forces(), empty_forces(), 1e-6
        energy(np.zeros(TURNS), to)
        g = [
            (energy(h * u, other) - energy(-h * u, other)) / (2 * h)
            for u in np.eye(TURNS)
        ]
        np.testing.assert_allclose(to.g, g, atol=1e-8 + 1e-6 * np.abs(to.g).max())
