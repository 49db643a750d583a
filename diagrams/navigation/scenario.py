"""The scenario of a navigation: a robot, its planner, and what is in its way."""

from dataclasses import dataclass, field, replace
from math import atan2, hypot, isfinite

from diagrams.common.scenario import Scenario, ScenarioError, nearest
from plants.crowd.crowd_motion import CrowdParams, starts
from plants.crowd.obstacle_motion import ObstacleParams, place_and_velocity
from plants.turtlebot.turtlebot import TurtlebotParams
from systems.switching.classical_planner import ClassicalParams
from systems.switching.perception import PerceptionParams
from systems.switching.statechart_planner import StatechartParams
from systems.switching.switching_state import SwitchingParams
from systems.switching.unicycle_control import UnicycleControlParams

PLANNERS = ("switching", "statechart", "classical")


@dataclass
class NavigationScenario(Scenario):
    """A mobile robot among obstacles (the thesis's chapters 4 and 5).

    Attributes:
        planner: One of `PLANNERS`.
        compare: Planners that the plots show in the same world, beside it.
        start: Where the robot starts, x, y [m]; it faces the goal.
        goal: Where it shall go, x, y [m].
        reach: Distance at which the goal counts as reached [m].
        obstacles: Discs and how they move.
        crowd: People who cross a circle, instead of obstacles.
        thesis_figures: Whether a run draws the thesis's figures, too.
    """

    planner: str = "switching"
    compare: list[str] = field(default_factory=list)
    start: list[float] = field(default_factory=lambda: [0.0, 0.0])
    goal: list[float] = field(default_factory=lambda: [8.0, 0.0])
    reach: float = 0.1
    obstacles: list[ObstacleParams] = field(default_factory=list)
    crowd: CrowdParams = field(default_factory=CrowdParams)
    thesis_figures: bool = False
    robot: TurtlebotParams = field(default_factory=TurtlebotParams)
    perception: PerceptionParams = field(default_factory=PerceptionParams)
    switching: SwitchingParams = field(default_factory=SwitchingParams)
    statechart: StatechartParams = field(default_factory=StatechartParams)
    classical: ClassicalParams = field(default_factory=ClassicalParams)
    control: UnicycleControlParams = field(default_factory=UnicycleControlParams)


def heading(scenario: NavigationScenario) -> float:
    """The robot's heading at the start: towards the goal [rad]."""
    (x, y), (gx, gy) = scenario.start, scenario.goal
    return atan2(gy - y, gx - x)


def discs(scenario: NavigationScenario) -> list[tuple[float, float, float]]:
    """x, y and radius [m] of everything in the way at time zero."""
    if scenario.crowd.people:
        return [(x, y, scenario.crowd.radius) for x, y in starts(scenario.crowd)]
    return [(*place_and_velocity(o, 0.0)[:2], o.radius) for o in scenario.obstacles]


def companions(scenario: NavigationScenario) -> dict[str, NavigationScenario]:
    """The same world with each of the planners to compare with, by planner."""
    return {
        name: replace(scenario, planner=name, compare=[])
        for name in scenario.compare
        if name != scenario.planner
    }


def check(scenario: NavigationScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    for part in vars(scenario).values():
        if hasattr(part, "check"):
            part.check()
    for index, obstacle in enumerate(scenario.obstacles):
        obstacle.check(f"obstacles[{index}]")
    for name in [scenario.planner, *scenario.compare]:
        if name not in PLANNERS:
            raise ScenarioError(f"planner={name!r}: {nearest(name, PLANNERS)}")
    for name in ("start", "goal"):
        point = getattr(scenario, name)
        if len(point) != 2 or not all(isfinite(x) for x in point):
            raise ScenarioError(f"{name}={point}: expected 2 finite numbers")
    if not scenario.reach > 0.0:
        raise ScenarioError(f"reach={scenario.reach} m: expected > 0")
    if scenario.crowd.people and scenario.obstacles:
        raise ScenarioError("obstacles and crowd.people: expected one of them")
    _check_room(scenario)


def _check_room(scenario: NavigationScenario) -> None:
    """Start and goal must be clear of obstacles, and obstacles be seen in time."""
    body = scenario.robot.radius
    safe = body + scenario.switching.margins[-1]
    vision = scenario.perception.vision
    for index, (x, y, radius) in enumerate(discs(scenario)):
        if radius + body >= vision:
            raise ScenarioError(
                f"obstacles[{index}].radius={radius} m with the robot's {body} m "
                f"exceeds perception.vision={vision} m: it would be hit before it is "
                f"seen; expected R_i < {vision - body:.3g}"
            )
        gap = hypot(x - scenario.start[0], y - scenario.start[1])
        if gap < radius + safe:
            raise ScenarioError(
                f"start={scenario.start} lies inside the safety circle of "
                f"obstacles[{index}]: {gap:.3g} m from its centre, expected at least "
                f"{radius + safe:.3g}"
            )
        still = not scenario.crowd.people and _stands(scenario.obstacles[index])
        gap = hypot(x - scenario.goal[0], y - scenario.goal[1])
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
    for index, obstacle in enumerate(scenario.obstacles):
        times = obstacle.times if obstacle.motion == "waypoints" else [0.0]
        speeds = [hypot(*place_and_velocity(obstacle, t)[2:]) for t in times]
        if max(speeds) >= scenario.robot.speed:
            found.append(index)
    return found
