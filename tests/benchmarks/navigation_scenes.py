"""The worlds of the benchmark: where the robot starts, and what moves about it.

No obstacle reacts to the robot, so a scene is the obstacles' whole motion,
computed beforehand. Every suite is a function of a seed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
import itertools
from math import cos, hypot, pi, sin

import numpy as np
from scipy import ndimage

from plants.crowd.orca import orca_towards
from plants.crowd.signals import Obstacle
from plants.crowd.walls import WallParams

Frame = list[tuple[float, float, float, float, float]]
"""x, y [m], radius [m], v_x, v_y [m/s] of every obstacle at one instant."""


@dataclass
class Robot:
    """The body that a suite gives to every planner."""

    radius: float = 0.18  # m
    speed: float = 0.5  # m/s
    turn_rate: float = 1.8  # rad/s; zero makes it holonomic
    acceleration: float = 1.0  # m/s^2
    turn_acceleration: float = 3.5  # rad/s^2
    vision: float = 3.0  # m
    reach: float = 0.1  # m, distance at which the goal counts as reached

    @property
    def holonomic(self) -> bool:
        """Whether it moves in any direction at once."""
        return self.turn_rate == 0.0


TURTLEBOT = Robot()
CROWD_ROBOT = Robot(0.3, 1.0, 0.0, 0.0, 0.0, 100.0, 0.3)


@dataclass
class Scene:
    """A start, a goal and the obstacles' motion."""

    name: str
    start: tuple[float, float]
    goal: tuple[float, float]
    frames: Callable[[int], Frame]  # by step
    robot: Robot = field(default_factory=lambda: TURTLEBOT)
    dt: float = 0.05  # s
    time_limit: float = 90.0  # s
    walls: list[WallParams] = field(default_factory=list)


def steady(discs: list[tuple[float, float, float, float, float]], dt: float):
    """Obstacles that keep their velocities."""

    def frame(k: int) -> Frame:
        t = k * dt
        return [(x + t * u, y + t * v, r, u, v) for x, y, r, u, v in discs]

    return frame


def listed(frames: list[Frame]):
    """Obstacles whose motion is a list of frames; they stand at its end."""
    last = [(x, y, r, 0.0, 0.0) for x, y, r, _, _ in frames[-1]]
    return lambda k: frames[k] if k < len(frames) else last


def crossing(seed: int, count: int = 104) -> list[Scene]:
    """One obstacle that crosses the robot's way, 0.2 to 0.8 m/s.

    Seed 0 is the full sweep of speeds, angles and arrival times; other seeds
    draw them at random from the same ranges.
    """
    rng = np.random.default_rng(seed)
    scenes = []
    for k in range(count):
        late = -3.0 + 0.5 * (k % 13)
        speed = (0.2, 0.4, 0.6, 0.8)[(k // 13) % 4]
        angle = (pi / 2, -2 * pi / 3)[(k // 52) % 2]
        if seed:
            late, speed = rng.uniform(-3.0, 3.0), rng.uniform(0.2, 0.8)
            angle = rng.choice([-1.0, 1.0]) * rng.uniform(pi / 4, 3 * pi / 4)
        u, v = speed * cos(angle), speed * sin(angle)
        t = 8.0 + late
        disc = (4.0 - t * u, -t * v, 0.3, u, v)
        scenes.append(
            Scene(f"crossing {k}", (0.0, 0.0), (8.0, 0.0), steady([disc], 0.05))
        )
    return scenes


def three_moving(seed: int, count: int = 100) -> list[Scene]:
    """Three obstacles that meet the robot's straight way as the robot does."""
    rng = np.random.default_rng(1000 + seed)
    scenes = []
    for k in range(count):
        discs = []
        for x in (3.0, 5.0, 7.0):
            speed, angle = rng.uniform(0.1, 0.45), rng.uniform(-pi, pi)
            u, v = speed * cos(angle), speed * sin(angle)
            t = max(x / 0.5 + rng.uniform(-2.0, 2.0), 0.0)
            radius = rng.uniform(0.2, 0.4)
            discs.append((x + rng.uniform(-0.5, 0.5) - t * u, -t * v, radius, u, v))
        if any(hypot(x, y) < 1.0 for x, y, *_ in discs):
            # Too near the start: moved on to the next draw, same count of scenes.
            discs = [d for d in discs if hypot(d[0], d[1]) >= 1.0]
            while len(discs) < 3:
                discs.append((5.0, 3.0 + len(discs), 0.3, 0.0, -0.3))
        scenes.append(Scene(f"three {k}", (0.0, 0.0), (10.0, 0.0), steady(discs, 0.05)))
    return scenes


def _bouncing(rng: np.random.Generator, count: int, steps: int) -> list[Frame]:
    """Discs in a box of 10 m x 10 m, thrown back by its walls."""
    radius = rng.uniform(0.2, 0.4, count)
    place = rng.uniform(radius, 10.0 - radius, (2, count))
    while (near := np.hypot(place[0] - 0.7, place[1] - 5.0) < 1.5 + radius).any():
        place[:, near] = rng.uniform(0.4, 9.6, (2, int(near.sum())))
    speed, angle = rng.uniform(0.1, 0.4, count), rng.uniform(-pi, pi, count)
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    frames = []
    for _ in range(steps):
        table = np.vstack([place, radius, velocity]).T
        frames.append([tuple(row) for row in table.tolist()])
        place = place + 0.05 * velocity
        out = (place < radius) & (velocity < 0.0)
        out |= (place > 10.0 - radius) & (velocity > 0.0)
        velocity = np.where(out, -velocity, velocity)
    return frames


def hopeless(scene: Scene, duration: float = 3.0) -> bool:
    """Whether the robot is hit at once whatever it does.

    It is if it is hit within `duration` both standing still and fleeing
    straight, at once and at full speed, in each of 16 directions.
    """
    ways = [(0.0, 0.0)] + [
        (scene.robot.speed * cos(k * pi / 8), scene.robot.speed * sin(k * pi / 8))
        for k in range(16)
    ]
    for u, v in ways:
        for k in range(int(duration / scene.dt)):
            x = scene.start[0] + k * scene.dt * u
            y = scene.start[1] + k * scene.dt * v
            reach = scene.robot.radius
            if any(
                hypot(a - x, b - y) < r + reach for a, b, r, _, _ in scene.frames(k)
            ):
                break
        else:
            return False
    return True


def fifteen_moving(seed: int, count: int = 100) -> list[Scene]:
    """Fifteen bouncing obstacles; worlds without a way out are left out."""
    rng = np.random.default_rng(2000 + seed)
    scenes: list[Scene] = []
    excluded = 0
    while len(scenes) < count:
        frames = _bouncing(rng, 15, 1800)
        name = f"fifteen {len(scenes)}"
        scene = Scene(name, (0.7, 5.0), (9.3, 5.0), listed(frames))
        if hopeless(scene):
            excluded += 1
            continue
        scenes.append(scene)
    if excluded:
        print(f"fifteen moving: {excluded} hopeless worlds left out")
    return scenes


def solvable(
    discs: list[tuple[float, float, float]],
    start: tuple[float, float],
    goal: tuple[float, float],
    clearance: float,
) -> bool:
    """Whether a body keeps `clearance` from all discs from start to goal."""
    step = 0.02
    points = np.array([start, goal] + [d[:2] for d in discs])
    low, high = points.min(0) - 2.0, points.max(0) + 2.0
    x, y = np.meshgrid(
        np.arange(low[0], high[0], step), np.arange(low[1], high[1], step)
    )
    free = np.ones_like(x, bool)
    for a, b, r in discs:
        free &= (x - a) ** 2 + (y - b) ** 2 > (r + clearance) ** 2
    labels, _ = ndimage.label(free)

    def label(p: tuple[float, float]) -> int:
        return labels[int((p[1] - low[1]) / step), int((p[0] - low[0]) / step)]

    return label(start) == label(goal) != 0


def _static(seed: int, n: int, count: int) -> list[Scene]:
    rng = np.random.default_rng(3000 + 17 * n + seed)
    scenes: list[Scene] = []
    start, goal = (0.0, 0.0), (8.0, 0.0)
    while len(scenes) < count:
        x, y = rng.uniform(1.0, 7.0, n), rng.uniform(-2.5, 2.5, n)
        r = rng.uniform(0.2, 0.5, n)
        discs = [
            (float(a), float(b), float(c)) for a, b, c in zip(x, y, r, strict=True)
        ]
        if any(min(hypot(a, b), hypot(a - 8.0, b)) < c + 0.5 for a, b, c in discs):
            continue
        if solvable(discs, start, goal, TURTLEBOT.radius + 0.12):
            still = [(a, b, c, 0.0, 0.0) for a, b, c in discs]
            scenes.append(
                Scene(f"static {n} {len(scenes)}", start, goal, steady(still, 0.05))
            )
    return scenes


def static_12(seed: int, count: int = 100) -> list[Scene]:
    """Twelve standing discs; a way with 0.12 m to spare exists."""
    return _static(seed, 12, count)


def static_20(seed: int, count: int = 100) -> list[Scene]:
    """Twenty standing discs; a way with 0.12 m to spare exists."""
    return _static(seed, 20, count)


def wall(points: list[tuple[float, float]], radius: float = 0.2):
    """Standing discs that touch each other along a chain of straight lines."""
    discs = []
    for (ax, ay), (bx, by) in itertools.pairwise(points):
        n = max(int(round(hypot(bx - ax, by - ay) / (2.0 * radius))), 1)
        for k in range(n + 1):
            s = k / n
            discs.append((ax + s * (bx - ax), ay + s * (by - ay), radius, 0.0, 0.0))
    return list(dict.fromkeys(discs))


def classics(seed: int = 0, count: int = 6) -> list[Scene]:
    """The six worlds on which methods are usually shown to fail."""
    del seed  # there is only one of each
    worlds = {
        "single on line": ([(4.0, 0.0, 0.5, 0.0, 0.0)], 8.0),
        "two, gap 0.6": (
            [(4.0, 0.8, 0.5, 0.0, 0.0), (4.0, -0.8, 0.5, 0.0, 0.0)],
            8.0,
        ),
        "two, no gap": (
            [(4.0, 0.6, 0.5, 0.0, 0.0), (4.0, -0.6, 0.5, 0.0, 0.0)],
            8.0,
        ),
        "U": (wall([(3.0, 1.2), (4.6, 1.2), (4.6, -1.2), (3.0, -1.2)]), 8.0),
        "big U": (wall([(2.0, 2.8), (5.2, 2.8), (5.2, -2.8), (2.0, -2.8)]), 9.0),
        "goal near obstacle": ([(8.75, 0.0, 0.4, 0.0, 0.0)], 8.0),
    }
    return [
        Scene(name, (0.0, 0.0), (x, 0.0), steady(discs, 0.05))
        for name, (discs, x) in list(worlds.items())[:count]
    ]


TRIES = 30_000
"""After so many draws without room for the next human, a case is jammed."""


@cache
def _humans(case: int, n: int) -> list[list[float]] | None:
    """Start and goal of the humans of a CrowdNav test case; None if they jam.

    Drawn as the CrowdNav code draws them (circle crossing, all humans alike). With
    twenty, about one case in sixty leaves no room for the last one.
    """
    rng = np.random.RandomState(case)
    people = [[0.0, -4.0, 0.0, 4.0]]  # the robot
    tries = 0
    while len(people) <= n:
        tries += 1
        if tries > TRIES:
            return None
        angle = rng.random_sample() * pi * 2.0
        x = 4.0 * cos(angle) + (rng.random_sample() - 0.5)
        y = 4.0 * sin(angle) + (rng.random_sample() - 0.5)
        clear = 0.3 + 0.3 + 0.2
        if all(
            hypot(x - a, y - b) >= clear and hypot(x - c, y - d) >= clear
            for a, b, c, d in people
        ):
            people.append([x, y, -x, -y])
    return people[1:]


class _Crowd:
    """Frames of a crowd, walked no further than anybody looks."""

    def __init__(self, case: int, n: int) -> None:
        people = _humans(case, n) or []
        self._goals = [(p[2], p[3]) for p in people]
        self._agents = [Obstacle(p[0], p[1], 0.3, 0.0, 0.0) for p in people]
        self._frames: list[Frame] = []

    def __call__(self, k: int) -> Frame:
        while len(self._frames) <= k:
            agents = self._agents
            self._frames.append(agents)
            moves = orca_towards(agents, self._goals, 1.0, 5.0, 0.25)
            self._agents = [
                Obstacle(x + 0.25 * u, y + 0.25 * v, r, u, v)
                for (x, y, r, _, _), (u, v) in zip(agents, moves, strict=True)
            ]
        return self._frames[k]


_crowd_frames = cache(_Crowd)


def _crowd(seed: int, n: int, count: int) -> list[Scene]:
    # Cases 100 to 599 are the test set of CrowdNav.
    cases = (case for case in itertools.count(100 + 10_000 * seed) if _humans(case, n))
    return [
        Scene(
            f"crowd {n} {case}",
            (0.0, -4.0),
            (0.0, 4.0),
            _crowd_frames(case, n),
            CROWD_ROBOT,
            0.25,
            25.0,
        )
        for case in itertools.islice(cases, count)
    ]


def crowd_5(seed: int, count: int = 500) -> list[Scene]:
    """CrowdNav circle crossing, five humans to whom the robot is invisible."""
    return _crowd(seed, 5, count)


def crowd_20(seed: int, count: int = 200) -> list[Scene]:
    """CrowdNav circle crossing, twenty humans to whom the robot is invisible."""
    return _crowd(seed, 20, count)


def in_hall(scene: Scene, half: float = 9.8) -> Scene:
    """The same world in a hall, by whose walls a robot can find its place.

    What moves goes through them.
    """
    x, y = (0.5 * (a + b) for a, b in zip(scene.start, scene.goal, strict=True))
    low_x, high_x, low_y, high_y = x - half, x + half, y - half, y + half
    corners = [[low_x, low_y], [high_x, low_y], [high_x, high_y], [low_x, high_y]]
    return replace(scene, walls=[WallParams([*corners, corners[0]])])


SUITES: dict[str, Callable[..., list[Scene]]] = {
    "one crossing": crossing,
    "three moving": three_moving,
    "fifteen moving": fifteen_moving,
    "static 12": static_12,
    "static 20": static_20,
    "classics": classics,
    "crowd 5": crowd_5,
    "crowd 20": crowd_20,
}
"""The suites by name."""
