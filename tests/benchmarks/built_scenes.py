"""Worlds with walls: corridors, doorways, T-crossings, traps of walls.

Whoever walks in them is slower than the robot, looks at nobody, and leaves room.
"""

from itertools import pairwise
from math import hypot

import numpy as np

from plants.crowd.obstacle_motion import ObstacleParams, obstacle_at
from plants.crowd.walls import WallParams
from tests.benchmarks.navigation_scenes import Frame, Scene

BODY = 0.25
"""Radius of a person [m]."""
ROOM = 0.8
"""What people in a corridor leave for the robot [m]."""
Places = list[list[float]]


def walker(points: Places, speed: float, late: float) -> ObstacleParams:
    """Somebody who walks along waypoints from a time on [s], and then stands."""
    times = [max(late, 0.0)]
    for (ax, ay), (bx, by) in pairwise(points):
        times.append(times[-1] + hypot(bx - ax, by - ay) / speed)
    return ObstacleParams("waypoints", BODY, times=times, points=points)


def world(
    name: str, goal: tuple[float, float], walls: list[Places], people: list
) -> Scene:
    """A scene from the origin."""

    def frames(k: int) -> Frame:
        return [tuple(obstacle_at(person, 0.05 * k)) for person in people]

    chains = [WallParams(points) for points in walls]
    return Scene(name, (0.0, 0.0), goal, frames, walls=chains)


def corridor(rng: np.random.Generator, name: str) -> Scene:
    """People come along it, or walk before the robot, on one side each."""
    half = rng.uniform(0.95, 1.3)
    walls = [[[-2.0, -half], [10.0, -half]], [[-2.0, half], [10.0, half]]]
    side = rng.choice([-1.0, 1.0])
    people = []
    for n in range(rng.integers(1, 4)):
        least = max(ROOM + BODY - half, 0.0)  # of the other half he leaves so much
        y = side * rng.uniform(least, half - BODY - 0.05)
        if rng.random() < 0.7:
            way = [[4.0 + 2.0 * n + rng.uniform(0.0, 1.0), y], [-12.0, y]]
        else:
            way = [[2.0 + 2.0 * n + rng.uniform(0.0, 1.0), y], [20.0, y]]
        people.append(walker(way, rng.uniform(0.2, 0.45), 0.0))
    return world(name, (8.0, 0.0), walls, people)


def doorway(rng: np.random.Generator, name: str) -> Scene:
    """A wall with a door, and somebody who passes behind it."""
    x, y, half = rng.uniform(3.0, 5.0), rng.uniform(-1.5, 1.5), rng.uniform(0.42, 0.6)
    walls = [[[x, -5.0], [x, y - half]], [[x, y + half], [x, 5.0]]]
    walls.append([[-2.0, -5.0], [10.0, -5.0], [10.0, 5.0], [-2.0, 5.0], [-2.0, -5.0]])
    far, sense = x + rng.uniform(0.9, 1.6), rng.choice([-1.0, 1.0])
    way = [[far, -4.5 * sense], [far, 4.5 * sense]]
    people = [walker(way, rng.uniform(0.2, 0.45), rng.uniform(0.0, 8.0))]
    return world(name, (8.0, 0.0), walls, people)


def crossing(rng: np.random.Generator, name: str) -> Scene:
    """A T: somebody comes round its corner as the robot does."""
    half, side, x = rng.uniform(0.9, 1.2), rng.choice([-1.0, 1.0]), 4.0
    wide = rng.uniform(0.7, 1.0)
    walls = [
        [[-2.0, -side * half], [10.0, -side * half]],
        [[-2.0, side * half], [x - wide, side * half], [x - wide, side * 6.0]],
        [[10.0, side * half], [x + wide, side * half], [x + wide, side * 6.0]],
    ]
    speed, sense = rng.uniform(0.25, 0.45), rng.choice([-1.0, -1.0, 1.0])
    lane = side * (half - BODY - rng.uniform(0.05, 0.3))
    a = x + rng.uniform(-0.5, 0.5) * (wide - BODY)
    away = max(speed * rng.uniform(2.0, 6.0), 0.6)
    way = [[a, side * (half + away)], [a, lane], [a + 12.0 * sense, lane]]
    meets = x / 0.5 + rng.uniform(-2.0, 2.0) - (away + BODY) / speed
    people = [walker(way, speed, meets)]
    return world(name, (8.0, 0.0), walls, people)


def trap(rng: np.random.Generator, name: str) -> Scene:
    """An L or a U of walls, open to the robot."""
    x, up, down = rng.uniform(3.0, 5.0), rng.uniform(0.6, 3.0), rng.uniform(0.6, 3.0)
    arm = rng.uniform(0.8, 2.5)
    chain = [[x - arm, up], [x, up], [x, -down]]
    if rng.random() < 0.5:
        chain.append([x - rng.uniform(0.8, 2.5), -down])
    if rng.random() < 0.5:
        chain = [[a, -b] for a, b in chain]
    return world(name, (8.0, 0.0), [chain], [])


KINDS = {"corridor": corridor, "doorway": doorway, "T": crossing, "trap": trap}


def built(seed: int, count: int = 300) -> list[Scene]:
    """Worlds of all four kinds in turn."""
    rng = np.random.default_rng(5000 + seed)
    kinds = list(KINDS.items())
    return [
        make(rng, f"{kind} {k}")
        for k in range(count)
        for kind, make in [kinds[k % len(kinds)]]
    ]
