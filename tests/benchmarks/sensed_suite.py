"""Switching potentials and others by lidar and odometry, in the same worlds.

Nobody sees the true pose, a velocity or an obstacle: all planners get the same place,
tracks and points. The suites of `switching` stand in a hall, by which it is found.
Worlds of walls, streams of people and obstacles faster than the robot are added.
"""

from collections.abc import Callable, Iterator, Sequence
import statistics

import numpy as np
from scipy import ndimage

from plants.crowd.signals import Obstacle
from plants.crowd.social_force import social_force_towards
from tests.benchmarks.built_scenes import built
from tests.benchmarks.navigation_loop import Planner, Result, run
from tests.benchmarks.navigation_scenes import (
    SUITES,
    Frame,
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
    cell, dt = 0.1, 0.1 / scene.robot.speed
    (x, y), (gx, gy) = scene.start, scene.goal
    middle = (0.5 * (x + gx), 0.5 * (y + gy))
    axis = np.arange(-9.0, 9.0, cell)
    px, py = np.meshgrid(middle[0] + axis, middle[1] + axis, indexing="ij")
    reach = np.hypot(px - x, py - y) < cell
    for k in range(round(duration / dt)):
        spread = ndimage.generate_binary_structure(2, 1 + k % 2)  # about a circle
        reach = ndimage.binary_dilation(reach, spread)
        for a, b, r, _, _ in scene.frames(round(k * dt / scene.dt)):
            reach &= np.hypot(px - a, py - b) >= r + scene.robot.radius
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


Make = Callable[..., list[Scene]]
IN_HALL: dict[str, Make] = {**SUITES, "faster": fast, "streams": streams}
LEGGED = {"crowd 5", "crowd 20", "streams"}
"""Suites whose obstacles are people: seen by their legs."""


def chosen() -> dict[str, Planner]:
    """Those of the other table, and the crowds' own two."""
    mine = {"ORCA (ours)": crowds("orca"), "social force": crowds("social_force")}
    return {k: v for k, v in planners().items() if "noisy" not in k} | mine


def row(name: str, results: Sequence[Result]) -> str:
    """Rates, medians, and how far the place was off."""
    n = len(results)
    rates = [
        f"{sum(r.outcome == outcome for r in results) / n:>9.3f}"
        for outcome in ("reached", "collided", "timeout")
    ]
    astray = max(r.astray for r in results)
    clearance = statistics.median(r.clearance for r in results)
    return f"  {name:<18}{''.join(rates)}{clearance:>9.2f} m{astray:>7.2f} m"


def tables(
    seed: int, scenes: int, suites: Sequence[str] = (), only: Sequence[str] = ()
) -> Iterator[str]:
    """A table for each suite as soon as it is there.

    Args:
        seed: Of the worlds, held out, and of all noise.
        scenes: How many of each suite; all from 300 on.
        suites: Names; all by default.
        only: Names of planners; all by default.
    """
    makes: dict[str, Make] = IN_HALL | {"walls": built}
    count = {} if scenes >= FULL else {"count": scenes}
    for name in suites or makes:
        worlds = makes[name](200 + seed, **count)
        if name in IN_HALL:
            worlds = [in_hall(scene) for scene in worlds]
        kept = worlds
        if name == "faster":
            kept = [scene for scene in worlds if avoidable(scene)]
        title = f"{name}: {len(kept)} of {len(worlds)} worlds"
        lines = [f"\n{title}; reached, collided, timeout, clearance, place off"]
        senses = Senses(*LEGS) if name in LEGGED else Senses()
        for planner, make in chosen().items():
            if not only or planner in only:
                results = [run(s, make, senses, i) for i, s in enumerate(kept)]
                lines.append(row(planner, results))
        yield "\n".join(lines)


def report(seed: int, scenes: int) -> str:
    """The tables of all suites."""
    return "\n".join(tables(seed, scenes))
