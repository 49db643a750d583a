"""What a policy is held against: our planners, chance, and straight on.

python -m diagrams.learning.baselines --episodes 20
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from diagrams.campaigns.statistics import share_interval
from diagrams.common.run import simulate
from diagrams.learning.environments import ENVIRONMENTS, Environment

type Policy = Callable[[Environment, np.ndarray], np.ndarray]


def chance(env: Environment, observation: np.ndarray) -> np.ndarray:
    """Any action."""
    action: np.ndarray = env.action_space.sample()
    return action


def straight(env: Environment, observation: np.ndarray) -> np.ndarray:
    """To the goal, whatever is in the way."""
    goal = {"GauzeDelivery": slice(3, 6), "SnakeReach": slice(3, 6)}
    way = observation[goal.get(type(env).__name__, slice(0, 2))]
    fastest = float(env.action_space.high[0])
    wanted: np.ndarray = way * fastest / max(float(np.abs(way).max()), 0.02)
    return wanted


def success(env: Environment, policy: Policy, seed: int) -> tuple[bool, int]:
    """Whether an episode succeeds, and the steps it took."""
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    steps = 0
    while True:
        observation, _, is_over, is_late, info = env.step(policy(env, observation))
        steps += 1
        if is_over or is_late:
            return bool(info["is_success"]), steps


def planned(env: Environment, seed: int) -> bool | None:
    """Whether the project's own planner succeeds in the same world; None without."""
    env.reset(seed=seed)
    if env.scenario.system == "snake":
        return None
    run: Any = simulate(replace(env.scenario, duration=env.limit))
    return bool(run.metrics["reached"])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=20)
    episodes = parser.parse_args().episodes
    print(
        f"{'environment':<18} {'policy':<12} success (95 % interval)   steps a second"
    )
    for name, make in ENVIRONMENTS.items():
        env = make()
        for policy in (chance, straight):
            began, results = perf_counter(), []
            for seed in range(episodes):
                results.append(success(env, policy, seed))
            rate = sum(n for _, n in results) / (perf_counter() - began)
            _row(name, policy.__name__, [ok for ok, _ in results], f"{rate:.0f}")
        told = [planned(env, seed) for seed in range(episodes)]
        if None not in told:
            _row(name, "our planner", [bool(ok) for ok in told], "")


def _row(name: str, policy: str, results: list[bool], rate: str) -> None:
    low, high = share_interval(sum(results), len(results))
    share = f"{sum(results)} of {len(results)} ({low:.2f} to {high:.2f})"
    print(f"{name:<18} {policy:<12} {share:<25} {rate}", flush=True)


if __name__ == "__main__":
    main()
