"""The environments keep gymnasium's rules, and what they say of themselves."""

import warnings

import gymnasium
from gymnasium.utils.env_checker import check_env
import numpy as np
import pytest

from diagrams.learning.baselines import planned, straight, success
from diagrams.learning.environments import ENVIRONMENTS

NAMES = [f"diagrams.learning:trocar/{name}" for name in ENVIRONMENTS]


def greedy(name, observation):
    """Straight to the goal."""
    if "Gauze" in name:
        return np.clip(3.0 * observation[3:6], -0.06, 0.06)
    if "Snake" in name:
        return np.clip(0.02 * observation[3:6], -0.01, 0.01)
    way = observation[:2]
    return 0.5 * way / max(np.linalg.norm(way), 0.5)


def episode(env, act, seed):
    """Observations, sum of rewards and the last step's info."""
    seen, total = [env.reset(seed=seed)[0]], 0.0
    while True:
        observation, reward, is_over, is_late, info = env.step(act(seen[-1]))
        seen.append(observation)
        total += reward
        if is_over or is_late:
            return np.array(seen), total, info


@pytest.mark.parametrize("name", NAMES)
def test_gymnasium_has_nothing_to_say(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("name", NAMES)
def test_same_seed_same_episode(name):
    env = gymnasium.make(name)
    first, total, _ = episode(env, lambda seen: greedy(name, seen), 7)
    again, same, _ = episode(env, lambda seen: greedy(name, seen), 7)
    assert (first == again).all()
    assert total == same
    assert (env.reset(seed=8)[0] != first[0]).any()


@pytest.mark.parametrize("name", [name for name in NAMES if "Crowd" not in name])
def test_straight_on_is_better_than_chance(name):
    env = gymnasium.make(name)
    env.action_space.seed(1)
    straight = episode(env, lambda seen: greedy(name, seen), 3)[1]
    chance = episode(env, lambda seen: env.action_space.sample(), 3)[1]
    assert straight > chance


def test_a_crowd_is_crossed_by_our_planner_but_not_straight_on():
    env = gymnasium.make("diagrams.learning:trocar/CrowdCrossing-v0").unwrapped
    assert planned(env, 3) and not success(env, straight, 3)[0]


def test_action_that_is_not_finite_or_too_large_is_held_to_the_space():
    env = gymnasium.make("diagrams.learning:trocar/SnakeReach-v0").unwrapped
    env.reset(seed=1)
    before = env.observe()[:3].copy()
    env.step(np.array([1e9, 0.0, 0.0]))
    assert np.abs(env.observe()[:3] - before).max() < 0.5  # cm


def test_vectorised_by_processes():
    envs = gymnasium.make_vec(
        "diagrams.learning:trocar/SnakeReach-v0",
        2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},
    )
    try:
        seen, _ = envs.reset(seed=[1, 2])
        assert seen.shape == (2, 10)
        assert (seen[0] != seen[1]).any()
        assert envs.step(np.zeros((2, 3)))[0].shape == (2, 10)
    finally:
        envs.close()
