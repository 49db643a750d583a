"""The scenario of a navigation: a robot, its planner, and what is in its way."""

from dataclasses import dataclass, replace
from functools import cache
from math import atan2, dist, hypot
from pathlib import Path

import numpy as np

from diagrams.common.scenario import Scenario, ScenarioError
from plants.crowd.crowd_motion import CrowdParams, starts
from plants.crowd.obstacle_motion import FAR, ObstacleParams, obstacle_at
from plants.crowd.recorded_crowd import load_obsmat
from plants.crowd.signals import Obstacle
from plants.crowd.walls import WallParams, segments, wall_distance
from plants.turtlebot.lidar import LidarParams
from plants.turtlebot.odometry import OdometryParams
from plants.turtlebot.turtlebot import TurtlebotParams
from systems.common.parameter import Rules, parameter, part
from systems.perception.grid_mapping import GridMappingParams
from systems.perception.signals import CELLS
from systems.perception.tracking import TrackingParams
from systems.switching.classical_planner import ClassicalParams
from systems.switching.heading_law import UnicycleControlParams
from systems.switching.orca_planner import OrcaParams
from systems.switching.perception import PerceptionParams
from systems.switching.statechart_planner import StatechartParams
from systems.switching.switching_state import SwitchingParams

PLANNERS = ("switching", "statechart", "classical", "orca")
SENSES = ("given", "lidar")


@dataclass
class NavigationScenario(Scenario):
    """A mobile robot among obstacles (the thesis's chapters 4 and 5)."""

    planner: str = parameter("switching", "who plans", choices=PLANNERS)
    compare: list[str] = parameter(
        [],
        "planners that the plots show in the same world, beside it",
        choices=PLANNERS,
        shape=(-1,),
    )
    start: list[float] = parameter(
        [0.0, 0.0],
        "where the robot starts, facing the goal: x, y",
        "m",
        shape=(2,),
        **FAR,
    )
    goal: list[float] = parameter(
        [8.0, 0.0], "where it shall go: x, y", "m", shape=(2,), **FAR
    )
    reach: float = parameter(
        0.1, "distance at which the goal is reached", "m", least=0.01, most=2.0
    )
    obstacles: list[ObstacleParams] = parameter(
        [], "discs and how they move", shape=(-1,)
    )
    recording: str = parameter(
        "", "people filmed, `obsmat.txt` of ETH or UCY, for obstacles", file=True
    )
    recording_start: float = parameter(
        0.0, "of the time that is played, since the first frame", "s", least=0, most=1e5
    )
    walls: list[WallParams] = parameter([], "what stands, seen by lidar", shape=(-1,))
    crowd: CrowdParams = part(CrowdParams)
    senses: str = parameter(
        "given",
        "what the robot knows: what is true within its vision, with the noise of "
        "perception, or what lidar and odometry tell",
        choices=SENSES,
    )
    lidar: LidarParams = part(LidarParams)
    odometry: OdometryParams = part(OdometryParams)
    mapping: GridMappingParams = part(GridMappingParams)
    tracking: TrackingParams = part(TrackingParams)
    thesis_figures: bool = parameter(False, "whether a run draws the thesis's figures")
    robot: TurtlebotParams = part(TurtlebotParams)
    perception: PerceptionParams = part(PerceptionParams)
    switching: SwitchingParams = part(SwitchingParams)
    statechart: StatechartParams = part(StatechartParams)
    classical: ClassicalParams = part(ClassicalParams)
    orca: OrcaParams = part(OrcaParams)
    control: UnicycleControlParams = part(UnicycleControlParams)

    def rules(self) -> Rules:
        """What must hold across fields."""
        given = [bool(self.crowd.people), bool(self.obstacles), bool(self.recording)]
        one = "none together with others: obstacles, crowd.people or a recording"
        yield sum(given) <= 1, "obstacles", one
        led = sum(obstacle.guided is not None for obstacle in self.obstacles)
        yield led <= 1, "obstacles", "at most one that is guided"
        way = dist(self.start, self.goal)
        told = f"it more than reach={self.reach} m from the start, not {way:.3g}"
        yield way > self.reach, "goal", told
        yield from wall_rules(self)
        yield from room_rules(self)


def heading(scenario: NavigationScenario) -> float:
    """The robot's heading at the start: towards the goal [rad]."""
    (x, y), (gx, gy) = scenario.start, scenario.goal
    return atan2(gy - y, gx - x)


def walking(scenario: NavigationScenario) -> list[ObstacleParams]:
    """The obstacles of a scenario, or the people of its recording."""
    if scenario.recording:
        return _filmed(scenario.recording, scenario.recording_start, scenario.duration)
    return scenario.obstacles


@cache
def _filmed(file: str, start: float, duration: float) -> list[ObstacleParams]:
    try:
        return load_obsmat(Path(file), start, duration)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"recording={file!r}: {error}") from error


def discs(scenario: NavigationScenario) -> list[Obstacle]:
    """Everything in the way at time zero."""
    if scenario.crowd.people:
        return starts(scenario.crowd)
    return [obstacle_at(params, 0.0) for params in walking(scenario)]


def driven(scenario: NavigationScenario) -> int | None:
    """Which of the obstacles somebody drives."""
    rows = [k for k, o in enumerate(scenario.obstacles) if o.guided is not None]
    return rows[0] if rows else None


def mapping_params(scenario: NavigationScenario) -> GridMappingParams:
    """The grid: its middle is that of start and goal where the scenario has none."""
    given = scenario.mapping
    if given.x or given.y:
        return given
    (x, y), (gx, gy) = scenario.start, scenario.goal
    return replace(given, x=0.5 * (x + gx), y=0.5 * (y + gy))


def companions(scenario: NavigationScenario) -> dict[str, NavigationScenario]:
    """The same world with each of the planners to compare with, by planner."""
    return {
        name: replace(scenario, planner=name, compare=[])
        for name in scenario.compare
        if name != scenario.planner
    }


def wall_rules(scenario: NavigationScenario) -> Rules:
    """Walls are seen by lidar, start and goal are clear of them, and on the grid."""
    seen = scenario.senses == "lidar"
    yield seen or not scenario.walls, "walls", "senses=lidar, which alone sees them"
    if not seen:
        return
    segments(scenario.walls)
    grid, body = mapping_params(scenario), scenario.robot.radius
    half = 0.5 * CELLS * grid.cell
    on_grid = (
        f"it on the grid, {2.0 * half:.3g} m wide about [{grid.x:.3g}, {grid.y:.3g}], "
        "or a larger mapping.cell"
    )
    for name in ("start", "goal"):
        x, y = place = getattr(scenario, name)
        yield max(abs(x - grid.x), abs(y - grid.y)) <= half, name, on_grid
        (gap,) = wall_distance(scenario.walls, np.array([place]))
        told = f"it {body:.3g} m from the walls as the robot sees them, not {gap:.3g}"
        yield gap >= body, name, told


def room_rules(scenario: NavigationScenario) -> Rules:
    """Start and goal are clear of obstacles, and obstacles are seen in time."""
    body, vision = scenario.robot.radius, scenario.perception.vision
    margins = scenario.switching.margins
    widest = body + margins[0]
    sees = vision > widest or scenario.planner != "switching"
    told = f"> {widest:.6g}, robot.radius and the first of switching.margins together"
    yield sees, "perception.vision", told
    for index, (x, y, radius, _, _) in enumerate(discs(scenario)):
        told = (
            f"> {radius + body:.3g}, or obstacles[{index}] of radius {radius} m is hit "
            "before it is seen"
        )
        yield radius + body < vision, "perception.vision", told
        gap, safe = dist((x, y), scenario.start), radius + body + margins[-1]
        told = (
            f"it outside the safety circle of obstacles[{index}], {safe:.3g} m from "
            f"its centre, not {gap:.3g}"
        )
        yield gap >= safe, "start", told
        still = not scenario.crowd.people and _stands(walking(scenario)[index])
        gap = dist((x, y), scenario.goal)
        told = (
            f"it {radius + body:.3g} m from the centre of obstacles[{index}], which "
            f"stands, not {gap:.3g}"
        )
        yield gap >= radius + body or not still, "goal", told


def _stands(obstacle: ObstacleParams) -> bool:
    if obstacle.motion == "waypoints":
        return len({tuple(point) for point in obstacle.points}) == 1
    return hypot(*obstacle.velocity) == 0.0


def outruns(scenario: NavigationScenario) -> list[int]:
    """Numbers of the obstacles that are at least as fast as the robot.

    No method can promise to avoid those; the robot still does its best.
    """
    found = []
    for index, obstacle in enumerate(walking(scenario)):
        times = obstacle.times if obstacle.motion == "waypoints" else [0.0]
        moves = [obstacle_at(obstacle, t) for t in times]
        if max(hypot(o.v_x, o.v_y) for o in moves) >= scenario.robot.speed:
            found.append(index)
    return found
