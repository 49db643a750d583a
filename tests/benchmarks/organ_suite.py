"""The way among organs in random scenes: reached, contact, clearance, time.

A scene has two or three organs of a bank of eight, at random places round the way of
R's tip, so that the straight way is not free; start and final pose are free, by 1 mm
more than what is held, at all phases of the breath. "standing": an obstacle tool stands
in the cavity besides. "moving": its tip swings to and fro with 10 to 40 mm/s at most,
30 mm or more from G_R. "breathing": the organs move by plus and minus 4 mm at 0.25 Hz,
and the tool stands. R is ideal (100 mm/s and 1 rad/s at most, plans with 60 mm/s), its
pivot exact, all states known. Clearance is that of the gauze's radius to the exact
triangles, at the instant that the grid says is the closest. The rival goes straight,
behind the same constraint.
"""

from dataclasses import dataclass
from functools import cache
from math import cos, log, pi, sin
import statistics
from typing import Any

import numpy as np

from diagrams.gauze.kinematic_loop import PLANNER_PERIOD, Robot, estimate
from diagrams.gauze.kinematic_planners import NO_CONE, around
from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.distance import Organs, distance, shaft_distance
from plants.organs.distance_grid import build, triangle_distance
from plants.organs.organs import PLAN_ROOM
from plants.organs.shapes import SHAPES, shape
from plants.organs.surface import Surface
from systems.bypass import clearance_constraint, safe_velocity, tool_bypass, workspace
from systems.bypass.clearance_constraint import ClearanceConstraintParams
from systems.bypass.organ_route import Found, choose_way_over, on_the_way, organ_room
from systems.bypass.shadow_body import pose_distance, read_tool
from systems.bypass.tool_bypass import ToolBypassParams
from systems.bypass.workspace import WorkspaceParams
from systems.common.compiled import compiled
from systems.common.geometry import along, norm, sub, unit
from systems.common.reach_limits import ReachLimits
from systems.common.signal import vector

KINDS = ("standing", "moving", "breathing")
G = (0.0, 0.0, 0.0)
SAFE = GAUZE_RADIUS + 0.002 + 0.0003
ROOM = workspace.constants(
    ReachLimits(min_insertion=0.03, max_insertion=0.25, max_tilt=1.2),
    WorkspaceParams(floor=-0.25),
)[0]
BYPASS = tool_bypass.constants(ToolBypassParams())[0]
CONSTRAINT = clearance_constraint.constants(ClearanceConstraintParams())[0]
ROBOT = Robot(least_insertion=0.03)
TIME_LIMIT = 20.0
BREATH, RATE = 0.004, 0.25


@cache
def bank() -> list[tuple[Surface, Any]]:
    """Surfaces, turned and scaled at random, and their grids."""
    found, rng = [], np.random.default_rng(77)
    for index in range(8):
        kind = list(SHAPES)[index % 4]
        own = shape(kind, index, 24)
        yaw, pitch = rng.uniform(0.0, 2 * pi), rng.uniform(-0.4, 0.4)
        R = np.array([[cos(yaw), -sin(yaw), 0], [sin(yaw), cos(yaw), 0], [0, 0, 1]])
        tilt = [[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]]
        points = rng.uniform(0.7, 1.1) * own.points @ (R @ tilt).T
        surface = Surface(np.ascontiguousarray(points), own.triangles)
        found.append((surface, build(surface, kind)))
    return found


@compiled
def exact_gap(
    points: np.ndarray, triangles: np.ndarray, off: np.ndarray, p: np.ndarray
) -> float:
    """Distance of a shaft from the origin to p from triangles, m, by samples."""
    least = 1e9
    for i in range(41):
        t = i / 40.0
        q = (t * p[0] - off[0], t * p[1] - off[1], t * p[2] - off[2])
        for k in range(len(triangles)):
            a, b, c = (
                points[triangles[k, 0]],
                points[triangles[k, 1]],
                points[triangles[k, 2]],
            )
            d = triangle_distance(
                q, (a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])
            )
            least = min(least, d)
    return least


@dataclass
class Scene:
    """Organs of the bank at places, R's way, and an obstacle tool."""

    which: list[int]
    places: np.ndarray
    start: Any
    goal: Any
    g_o: Any
    tip: np.ndarray
    swing: np.ndarray
    rate: float
    breath: float

    def organs(self, time: float) -> Organs:
        """The organs at a time."""
        moved = np.zeros((len(self.which), 6))
        moved[:, :3] = self.places
        phase = 2.0 * pi * RATE * time
        moved[:, 2] += self.breath * sin(phase)
        moved[:, 5] = self.breath * 2.0 * pi * RATE * cos(phase)
        values, table = packed(tuple(self.which))
        return Organs(values, table, moved)

    def tool(self, time: float) -> Any:
        """The obstacle tool's estimate at a time."""
        p = self.tip + self.swing * sin(self.rate * time)
        v = self.swing * self.rate * cos(self.rate * time)
        return estimate(p.tolist(), self.g_o, v.tolist())


@cache
def packed(which: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Values and table of some of the bank."""
    rows, first, values = [], 0, []
    for index in which:
        grid = bank()[index][1]
        counts = grid.values.shape
        row = [*grid.origin, grid.spacing, *counts, first, SAFE, SAFE + PLAN_ROOM]
        rows.append(row)
        values.append(grid.values.ravel())
        first += grid.values.size
    return np.concatenate(values), np.array(rows)


def point(rng: np.random.Generator) -> tuple[float, float, float]:
    """A place for a tip under G."""
    tilt, turn = rng.uniform(0.1, 0.75), rng.uniform(0.0, 2 * pi)
    q = rng.uniform(0.08, 0.15)
    return vector(
        (q * sin(tilt) * cos(turn), q * sin(tilt) * sin(turn), -q * cos(tilt))
    )


def is_clear(one: Scene, p: Any, time: float, room: float = 0.001) -> bool:
    """Whether R may be there."""
    tool = read_tool(around(one.tool(time), ())[0])
    free, _ = organ_room(one.organs(time), 0.0, G, p)
    return free > room and pose_distance(tool, G, p) > tool.safe + 0.0015


def scene(kind: str, seed: int, number: int) -> Scene:
    """A random scene."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    breath = BREATH if kind == "breathing" else 0.0
    while True:
        start, goal = point(rng), point(rng)
        if not 0.05 < norm(sub(start, goal)) < 0.14:
            continue
        which = rng.choice(8, rng.integers(2, 4), replace=False).tolist()
        middle = 0.5 * np.add(start, goal)
        places = middle + rng.normal(0.0, 0.045, (len(which), 3))
        turn = rng.uniform(0.0, 2 * pi)
        g_o = (0.09 * cos(turn), 0.09 * sin(turn), 0.0)
        tip = np.array(point(rng))
        swing, rate = np.zeros(3), 0.0
        if kind == "moving":
            swing = rng.normal(0.0, 0.02, 3)
            rate = rng.uniform(0.01, 0.04) / max(np.linalg.norm(swing), 1e-3)
        one = Scene(which, places, start, goal, g_o, tip, swing, rate, breath)
        times = np.linspace(0.0, 1.0 / RATE, 9) if breath else [0.0]
        if any(not is_clear(one, p, t) for p in (start, goal) for t in times):
            continue
        if swing.any():
            phases = np.linspace(0.0, 2 * pi, 24) / rate
            rows = [read_tool(around(one.tool(t), ())[0]) for t in phases]
            if min(np.linalg.norm(one.tool(t).p) for t in phases) < 0.03:
                continue
            if any(pose_distance(r, G, goal) < r.safe + 0.0015 for r in rows):
                continue
        organs = one.organs(0.0)
        if min(distance(organs, k, G) for k in range(len(which))) < SAFE + 0.04:
            continue
        way = [along(start, t, sub(goal, start)) for t in np.linspace(0.0, 1.0, 21)]
        if all(organ_room(organs, 0.0, G, p)[0] > 0.0 for p in way):
            continue
        return one


@dataclass
class Outcome:
    """What came of a scene; clearance in m, time in s or None."""

    reached: bool
    clearance: float
    tool_clearance: float
    time: float | None


def run(one: Scene, bypass: bool) -> Outcome:
    """Runs a scene to its arrival or the limit."""
    p, v_tip, found = one.start, (0.0, 0.0, 0.0), Found(G, 0.0, 0, 0, G)
    dodging, least, at, nearest = np.zeros(1), 1e9, (p, 0.0), 1e9
    arrival = None
    for step in range(round(TIME_LIMIT / PLANNER_PERIOD)):
        time = step * PLANNER_PERIOD
        organs, tools = one.organs(time), around(one.tool(time), ())
        if bypass:
            is_there = found.edge != 0 and norm(sub(found.corner, p)) < 0.003
            if step % 4 == 0 or is_there:
                found = choose_way_over(
                    BYPASS,
                    ROOM,
                    NO_CONE,
                    organs,
                    G,
                    p,
                    one.goal,
                    tools,
                    found.edge,
                    found.waits,
                )
            way = on_the_way(found, p, one.goal)
        else:
            d = sub(one.goal, p)
            way = tool_bypass.Choice(unit(d), norm(d), 0, 0, one.goal)
        v_tip = tool_bypass.follow(BYPASS, v_tip, PLANNER_PERIOD, G, way)
        still = np.zeros((1 + len(tools), 3))
        v, dodging, _ = safe_velocity.constrain(
            CONSTRAINT, ROOM, NO_CONE, G, p, v_tip, tools, dodging, still, organs
        )
        p = ROBOT.moved(G, p, v, PLANNER_PERIOD)
        time += PLANNER_PERIOD
        organs = one.organs(time)
        for k in range(len(one.which)):
            d, _ = shaft_distance(organs, k, G, p, 0.02)
            if d < least:
                least, at = d, (p, time)
        tool = read_tool(around(one.tool(time), ())[0])
        nearest = min(nearest, pose_distance(tool, G, p) - 0.005)
        if norm(sub(p, one.goal)) < 1e-3:
            arrival = time
            break
    organs = one.organs(at[1])
    exact = min(
        exact_gap(*bank()[k][0], organs.moved[i, :3], np.array(at[0]))
        for i, k in enumerate(one.which)
    )
    touched = exact < GAUZE_RADIUS or nearest <= 0.0
    return Outcome(
        arrival is not None and not touched, exact - GAUZE_RADIUS, nearest, arrival
    )


def alone(one: Scene) -> float:
    """How long the straight way takes with nothing there, s."""
    v, k = 0.06, 4.0  # cruise, then exponentially to within 1 mm
    return norm(sub(one.start, one.goal)) / v - 1 / k + log(v / k / 1e-3) / k + 0.03


def row(name: str, outcomes: list[Outcome], straight: list[float]) -> str:
    """A line of the table."""
    reached = sum(o.reached for o in outcomes)
    contact = sum(o.clearance <= 0.0 or o.tool_clearance <= 0.0 for o in outcomes)
    pairs = zip(outcomes, straight, strict=True)
    ratios = sorted(o.time / s for o, s in pairs if o.time and o.reached)
    middle = statistics.median(ratios) if ratios else float("nan")
    high = ratios[int(0.95 * (len(ratios) - 1))] if ratios else float("nan")
    least = 1e3 * min(o.clearance for o in outcomes)
    tools = 1e3 * min(o.tool_clearance for o in outcomes)
    return (
        f"  {name:<22} {reached:>4} / {len(outcomes):<4} contact {contact:<3} least "
        f"{least:5.2f} mm organs {tools:5.2f} mm tools, ratio {middle:.2f} {high:.2f}"
    )


def report(seed: int, scenes: int) -> str:
    """A table of all kinds."""
    lines = []
    for kind in KINDS:
        them = [scene(kind, seed, number) for number in range(scenes)]
        straight = [alone(s) for s in them]
        for name, bypass in (("bypass", True), ("straight", False)):
            found = [run(one, bypass) for one in them]
            lines.append(row(f"{kind}: {name}", found, straight))
            stuck = [i for i, o in enumerate(found) if not o.reached]
            if bypass and stuck:
                lines.append(f"    not reached: {stuck[:20]}")
    return "\n".join(lines)
