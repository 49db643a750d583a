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
from systems.common.parameter import parameter, part
from systems.perception.grid_mapping import GridMappingParams
from systems.perception.signals import CELLS
from systems.perception.tracking import TrackingParams
from systems.switching.classical_planner import ClassicalParams
from systems.switching.perception import PerceptionParams
from systems.switching.statechart_planner import StatechartParams
from systems.switching.switching_state import SwitchingParams
from systems.switching.unicycle_control import UnicycleControlParams

PLANNERS = ("switching", "statechart", "classical")
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
    control: UnicycleControlParams = part(UnicycleControlParams)


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


def check(scenario: NavigationScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    given = [bool(scenario.crowd.people), bool(scenario.obstacles)]
    if sum([*given, bool(scenario.recording)]) > 1:
        raise ScenarioError(
            "obstacles, crowd.people and recording: expected one of them"
        )
    way = dist(scenario.start, scenario.goal)
    if way <= scenario.reach:
        raise ScenarioError(
            f"goal={scenario.goal}: {way:.3g} m from start={scenario.start}, expected "
            f"more than reach={scenario.reach} m"
        )
    _check_walls(scenario)
    _check_room(scenario)


def _check_walls(scenario: NavigationScenario) -> None:
    """Walls are seen by lidar, start and goal are clear of them, and on the grid."""
    if scenario.senses == "given":
        if scenario.walls:
            raise ScenarioError("walls: expected senses=lidar, which alone sees them")
        return
    segments(scenario.walls)
    grid, body = mapping_params(scenario), scenario.robot.radius
    half = 0.5 * CELLS * grid.cell
    ends = {"start": scenario.start, "goal": scenario.goal}
    for name, place in ends.items():
        if max(abs(place[0] - grid.x), abs(place[1] - grid.y)) > half:
            raise ScenarioError(
                f"{name}={place}: beyond the grid, {2.0 * half:.3g} m wide about "
                f"[{grid.x:.3g}, {grid.y:.3g}]; expected within it, or a larger "
                "mapping.cell"
            )
    gaps = wall_distance(scenario.walls, np.array(list(ends.values())))
    for (name, place), gap in zip(ends.items(), gaps, strict=True):
        if gap < body:
            raise ScenarioError(
                f"{name}={place} lies in a wall as the robot sees it: {gap:.3g} m from "
                f"it, expected at least {body:.3g}"
            )


def _check_room(scenario: NavigationScenario) -> None:
    """Start and goal must be clear of obstacles, and obstacles be seen in time."""
    body = scenario.robot.radius
    safe = body + scenario.switching.margins[-1]
    vision = scenario.perception.vision
    widest = body + scenario.switching.margins[0]
    if scenario.planner == "switching" and vision <= widest:
        raise ScenarioError(
            f"perception.vision={vision} m: expected > {widest:.6g}, robot.radius and "
            "the first of switching.margins together"
        )
    for index, (x, y, radius, _, _) in enumerate(discs(scenario)):
        if radius + body >= vision:
            raise ScenarioError(
                f"obstacles[{index}].radius={radius} m with the robot's {body} m "
                f"exceeds perception.vision={vision} m: it would be hit before it is "
                f"seen; expected R_i < {vision - body:.3g}"
            )
        gap = dist((x, y), scenario.start)
        if gap < radius + safe:
            raise ScenarioError(
                f"start={scenario.start} lies inside the safety circle of "
                f"obstacles[{index}]: {gap:.3g} m from its centre, expected at least "
                f"{radius + safe:.3g}"
            )
        still = not scenario.crowd.people and _stands(walking(scenario)[index])
        gap = dist((x, y), scenario.goal)
        if still and gap < radius + body:
            raise ScenarioError(
                f"goal={scenario.goal} lies inside obstacles[{index}] as the robot "
                f"sees it: {gap:.3g} m from its centre, expected at least "
                f"{radius + body:.3g}"
            )


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
