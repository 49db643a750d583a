"""A navigation live: somebody drives an obstacle."""

from typing import Any

import numpy as np

from diagrams.common.live import KEYS, Figure, Guided, Live, Slider
from diagrams.navigation.plots import state_names
from diagrams.navigation.scenario import NavigationScenario
from plants.crowd.guided_disc import Place
from plants.crowd.signals import OBSTACLES
from plants.turtlebot.signals import RobotState
from systems.switching.signals import Mode

AROUND = 1.5
"""What is worth seeing an obstacle can be driven [m]."""


def guided(scenario: NavigationScenario) -> list[Guided]:
    """The first obstacle; of a crowd, whose people look where they go, nobody."""
    if not scenario.obstacles:
        return []
    first = scenario.obstacles[0]
    x, y = first.points[0] if first.motion == "waypoints" else first.start
    ends = np.array([scenario.start, scenario.goal, [x, y]])
    lows, highs = ends.min(axis=0) - AROUND, ends.max(axis=0) + AROUND
    sliders = [
        Slider(f"obstacle {axis} [m]", low, high, 0.05, 1.0, keys)
        for axis, low, high, keys in zip("xy", lows, highs, KEYS[0], strict=False)
    ]
    owner = lambda scenario: scenario.obstacles[0]  # noqa: E731
    return [Guided("obstacle", Place, Place(x, y), owner, "guided", tuple(sliders))]


def held(scenario: NavigationScenario, names: list[str]) -> NavigationScenario:
    """Plots beside other planners would be of other worlds."""
    scenario.compare = []
    return scenario


def clearance(session: Any) -> float:
    """Between the robot and what is nearest [m]; 10 for nothing."""
    robot, rows = state(session), session.read("obstacles.rows", OBSTACLES)
    there = rows.radius > 0.0
    away = np.hypot(rows.x - robot.x, rows.y - robot.y) - rows.radius
    radius: float = session.scenario.robot.radius
    return float(away[there].min(initial=10.0 + radius)) - radius


def to_goal(session: Any) -> float:
    """Of the robot to its goal [m]."""
    robot, goal = state(session), session.scenario.goal
    return float(np.hypot(goal[0] - robot.x, goal[1] - robot.y))


def state(session: Any) -> Any:
    """The robot's."""
    return session.read("robot.state", RobotState)


def words(session: Any) -> str:
    """The planner's state, or that it is there."""
    if to_goal(session) <= session.scenario.reach:
        return "goal reached"
    number = round(float(session.read("planner.mode", Mode).state))
    name: str = state_names(session.scenario.planner)[number]
    return name


def streamed(session: Any) -> dict[str, Any]:
    """The robot, and who is driven, as places on the floor."""
    robot, rows = state(session), session.read("obstacles.rows", OBSTACLES)
    told = {"Robot": ([robot.x, robot.y, 0.0], None)}
    for row in np.flatnonzero(rows.radius > 0.0).tolist():
        told[f"Obstacle{row}"] = ([rows.x[row], rows.y[row], 0.0], None)
    return told


LIVE = Live(
    guided=guided,
    held=held,
    figures=lambda scenario: [
        Figure("clearance [m]", clearance, -0.5, 10.0, 0.01, 1.0),
        Figure("to the goal [m]", to_goal, 0.0, 20.0, 0.01, 1.0),
    ],
    words=words,
    fastest=2.0,
    moving=lambda session: [state(session).x, state(session).y, 0.0],
    streamed=streamed,
    frame=0.05,  # the planner's clock: other instants would cost steps
)
