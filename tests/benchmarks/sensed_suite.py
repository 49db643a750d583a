"""Switching potentials and others by lidar and odometry, in the same worlds.

Nobody sees the true pose, a velocity or an obstacle: all planners get the same place,
tracks and points. The suites of `switching` stand in a hall, by which it is found.
Worlds of walls, streams of people, filmed ones and obstacles faster than the robot are
added. `python -m tests.benchmarks.sensed_suite --suites recorded --recording FILE`
takes the people of an `obsmat.txt` of ETH or UCY.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import pi
from pathlib import Path
import statistics

import numpy as np
from scipy import ndimage

from plants.crowd.obstacle_motion import ObstacleParams, obstacle_at
from plants.crowd.recorded_crowd import RATE, load_obsmat
from plants.crowd.signals import Obstacle
from plants.crowd.social_force import social_force_towards
from tests.benchmarks.built_scenes import built
from tests.benchmarks.navigation_loop import Planner, Result, run
from tests.benchmarks.navigation_scenes import (
    SUITES,
    Frame,
    Robot,
    Scene,
    in_hall,
    listed,
    steady,
)
from tests.benchmarks.navigators import crowds, planners
from tests.benchmarks.sensed import LEGS, Senses
from tests.benchmarks.switching_suite import FULL


def fast(seed: int, count: int = 100) -> list[Scene]:
    """Three obstacles at 1 to 2 times the robot's speed, met as it goes straight."""
    rng = np.random.default_rng(7000 + seed)
    scenes = []
    for k in range(count):
        discs = []
        for x in (3.0, 5.0, 7.0):
            speed, angle = rng.uniform(0.5, 1.0), rng.uniform(-np.pi, np.pi)
            u, v = speed * np.cos(angle), speed * np.sin(angle)
            t = x / 0.5 + rng.uniform(-2.0, 2.0)
            discs.append((x - t * u, -t * v, 0.3, u, v))
        scenes.append(Scene(f"fast {k}", (0.0, 0.0), (10.0, 0.0), steady(discs, 0.05)))
    return scenes


def avoidable(scene: Scene, duration: float = 24.0) -> bool:
    """Whether a body without inertia could be hit by nobody, wherever it flees.

    All places that it can reach are carried on, step by step, on a grid of 0.1 m: what
    is said to be unavoidable is so for every planner, not the other way round.
    """
    cell, dt, n = 0.1, 0.1 / scene.robot.speed, 180
    (x, y), (gx, gy) = scene.start, scene.goal
    middle = (0.5 * (x + gx), 0.5 * (y + gy))
    axis = cell * (np.arange(n) - n / 2)
    ax, ay = middle[0] + axis, middle[1] + axis
    reach = np.hypot(ax[:, None] - x, ay - y) < cell
    for k in range(round(duration / dt)):
        spread = ndimage.generate_binary_structure(2, 1 + k % 2)  # about a circle
        reach = ndimage.binary_dilation(reach, spread)
        for a, b, r, _, _ in scene.frames(round(k * dt / scene.dt)):
            size = r + scene.robot.radius
            i, j = (
                slice(
                    max(int((c - size) / cell), 0), max(int((c + size) / cell + 2), 0)
                )
                for c in (a - ax[0], b - ay[0])
            )
            reach[i, j] &= np.hypot(ax[i, None] - a, ay[j] - b) >= size
        if not reach.any():
            return False
    return True


def streams(seed: int, count: int = 100) -> list[Scene]:
    """Two streams of people by the social force, who do not see the robot."""
    rng = np.random.default_rng(8000 + seed)
    scenes = []
    for k in range(count):
        people, goals = [], []
        for sense in (-1.0, 1.0):
            for n in range(rng.integers(5, 10)):
                x, y = rng.uniform(2.5, 5.5), -sense * (2.5 + 0.9 * n)
                people.append(Obstacle(x, y + rng.uniform(-0.3, 0.3), 0.25, 0.0, 0.0))
                goals.append((x + rng.uniform(-1.0, 1.0), sense * 14.0))
        frames: list[Frame] = []
        for _ in range(900):
            frames.append([tuple(p) for p in people])
            moves = social_force_towards(people, goals, 0.42, 0.05)
            people = [
                p._replace(x=p.x + 0.05 * u, y=p.y + 0.05 * v, v_x=u, v_y=v)
                for p, (u, v) in zip(people, moves, strict=True)
            ]
        name = f"streams {k}"
        scenes.append(Scene(name, (0.0, 0.0), (8.0, 0.0), listed(frames)))
    return scenes


RECORDING = Path(__file__).parents[2] / "diagrams/navigation/scenarios/two_streams.txt"
"""Of the form of ETH and UCY, made by the social force."""
WALKED = Robot(vision=6.0)
"""A TurtleBot whose tracks count as far: people walk at up to three times its speed."""


def recorded(
    seed: int, count: int = 100, recording: Path = RECORDING, duration: float = 40.0
) -> list[Scene]:
    """Filmed people, from times on drawn at random; the robot crosses their middle.

    It starts clear of them, and its goal is not where somebody stands.
    """
    rng = np.random.default_rng(9000 + seed)
    table = np.loadtxt(recording)
    frames = np.unique(table[:, 0])
    length = (frames[-1] - frames[0]) / np.diff(frames).min() / RATE
    middle = np.median(table[:, [2, 4]], axis=0)
    scenes: list[Scene] = []
    for _ in range(50 * count):
        if len(scenes) == count:
            break
        begin, angle = rng.uniform(0.0, max(length - duration, 1.0)), rng.uniform(0, pi)
        half = 4.0 * np.array([np.cos(angle), np.sin(angle)])
        try:
            people = load_obsmat(recording, begin, duration)
        except ValueError:  # nobody is there then
            continue
        ways = np.array([[obstacle_at(one, t)[:2] for one in people]
                         for t in np.arange(0.0, duration, 1.0)])  # fmt: skip
        gone = np.linalg.norm(ways - (middle + half), axis=2) < 0.8
        if (
            gone.mean(axis=0).max() > 0.2
            or not np.linalg.norm(ways - middle, axis=2).min() < 3.0
        ):
            continue
        if np.linalg.norm(ways[0] - (middle - half), axis=1).min() < 1.2:
            continue
        frames_of = partial(_filmed, people)
        ends = tuple((middle - half).tolist()), tuple((middle + half).tolist())
        name = f"recorded {len(scenes)}"
        scenes.append(Scene(name, *ends, frames_of, WALKED, time_limit=duration))
    return scenes


def _filmed(people: list[ObstacleParams], step: int) -> Frame:
    return [tuple(obstacle_at(person, 0.05 * step)) for person in people]


Make = Callable[..., list[Scene]]
IN_HALL: dict[str, Make] = {
    **SUITES, "streams": streams, "recorded": recorded, "faster": fast
}  # fmt: skip
LEGGED = {"crowd 5", "crowd 20", "streams", "recorded"}
"""Suites whose obstacles are people: seen by their legs."""


FASTER = {"recorded", "faster"}
"""Suites of which only the worlds count that could be survived at all."""


def chosen() -> dict[str, Planner]:
    """Those of the other table that see what moves, and the crowds' own two."""
    mine = {"ORCA (ours)": crowds("orca"), "social force": crowds("social_force")}
    blind = ("noisy", "statechart")
    others = planners().items()
    return {k: v for k, v in others if not any(word in k for word in blind)} | mine


def row(name: str, results: Sequence[Result], speed: float) -> str:
    """Rates, medians, and how far the place was off.

    In brackets the collisions with what was slower than the robot's greatest speed,
    whichever of the two moved.
    """
    n = len(results)
    rates = [
        f"{sum(r.outcome == outcome for r in results) / n:>9.3f}"
        for outcome in ("reached", "collided", "timeout")
    ]
    astray = max(r.astray for r in results)
    clearance = statistics.median(r.clearance for r in results)
    slower = sum(r.outcome == "collided" and r.met < speed for r in results) / n
    rates.insert(2, f" ({slower:.3f})")
    return f"  {name:<26}{''.join(rates)}{clearance:>9.2f} m{astray:>7.2f} m"


def tables(
    seed: int,
    scenes: int,
    suites: Sequence[str] = (),
    only: Sequence[str] = (),
    recording: Path = RECORDING,
) -> Iterator[str]:
    """A table for each suite as soon as it is there.

    Args:
        seed: Of the worlds, held out, and of all noise.
        scenes: How many of each suite; all from 300 on.
        suites: Names; all by default.
        only: Names of planners; all by default.
        recording: The people of the suite `recorded`.
    """
    makes: dict[str, Make] = IN_HALL | {"walls": built}
    makes["recorded"] = partial(recorded, recording=recording)
    count = {} if scenes >= FULL else {"count": scenes}
    for name in suites or makes:
        worlds = makes[name](200 + seed, **count)
        if name in IN_HALL:
            worlds = [in_hall(scene) for scene in worlds]
        kept = worlds
        if name in FASTER:
            kept = [scene for scene in worlds if avoidable(scene)]
        title = f"{name}: {len(kept)} of {len(worlds)} worlds"
        lines = [
            f"\n{title}; reached, collided (slower), timeout, clearance, place off"
        ]
        senses = Senses(*LEGS) if name in LEGGED else Senses()
        for planner, make in chosen().items():
            if not only or planner in only:
                results = [run(s, make, senses, i) for i, s in enumerate(kept)]
                lines.append(row(planner, results, kept[0].robot.speed))
        yield "\n".join(lines)


def main() -> None:
    """Runs the command line: some suites, some planners."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the worlds")
    parser.add_argument("--scenes", type=int, default=12, help="of each suite")
    parser.add_argument("--suites", nargs="*", default=(), help="all by default")
    parser.add_argument("--only", nargs="*", default=(), help="planners")
    parser.add_argument("--recording", type=Path, default=RECORDING, metavar="FILE")
    told = parser.parse_args()
    for table in tables(**vars(told)):
        print(table, flush=True)


def report(seed: int, scenes: int) -> str:
    """The tables of all suites."""
    return "\n".join(tables(seed, scenes))


if __name__ == "__main__":
    main()
