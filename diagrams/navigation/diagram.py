"""The diagram of a navigation: perception, planning, action (the thesis's Figure 1)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, RandomSource

from diagrams.common.wiring import add_blocks, finish
from diagrams.navigation.scenario import NavigationScenario, discs, heading
from plants.crowd.crowd_motion import CrowdMotion
from plants.crowd.obstacle_motion import ObstacleMotion
from plants.turtlebot.arena import add_arena
from plants.turtlebot.turtlebot import make_turtlebot
from systems.common.signal import size
from systems.switching.classical_planner import ClassicalPlanner
from systems.switching.navigation_planner import PERIOD
from systems.switching.perception import Perception
from systems.switching.signals import NOISE
from systems.switching.statechart_planner import StatechartPlanner
from systems.switching.switching_planner import SwitchingPlanner
from systems.switching.unicycle_control import UnicycleControl

WIRES = (
    # Perception: the obstacles within the disc of vision.
    ("robot.y0", "perception.robot"),
    ("obstacles.obstacles", "perception.obstacles"),
    ("noise.output", "perception.noise"),
    # Planning: one potential, one velocity.
    ("robot.y0", "planner.robot"),
    ("perception.seen", "planner.seen"),
    ("goal.y0", "planner.goal"),
    # Action: the velocity becomes speed and turn rate.
    ("robot.y0", "control.robot"),
    ("planner.v_R", "control.v_R"),
    ("planner.mode", "control.mode"),
    ("control.command", "robot.u0"),
    # What people see.
    ("robot.y0", "arena.robot"),
    ("obstacles.obstacles", "arena.obstacles"),
)
"""Every signal of the diagram."""

EXPORTS = {
    "robot.state": "robot.y0",
    "obstacles.rows": "obstacles.obstacles",
    "planner.v_R": "planner.v_R",
    "planner.mode": "planner.mode",
    "control.command": "control.command",
    "scene_graph.query": "scene_graph.query",
}
"""What can be logged, and drawn."""


def make_planner(scenario: NavigationScenario) -> Any:
    """The planner that the scenario names; its body and limits are the robot's."""
    radius, speed = scenario.robot.radius, scenario.robot.speed
    if scenario.planner == "classical":
        classical = replace(scenario.classical, body_radius=radius, speed=speed)
        return ClassicalPlanner(classical)
    if scenario.planner == "statechart":
        statechart = replace(scenario.statechart, body_radius=radius, speed=speed)
        return StatechartPlanner(statechart)
    switching = replace(
        scenario.switching,
        body_radius=radius,
        speed=speed,
        vision=scenario.perception.vision,
        # What stands must not seem to move by the noise of its measured velocity.
        standing_speed=max(
            scenario.switching.standing_speed, 3.0 * scenario.perception.velocity_noise
        ),
    )
    return SwitchingPlanner(switching)


def make_blocks(scenario: NavigationScenario) -> dict[str, Any]:
    """The blocks of the diagram, by the names that `WIRES` uses."""
    s = scenario
    if s.crowd.people:
        obstacles: Any = CrowdMotion(s.crowd)
    else:
        obstacles = ObstacleMotion(s.obstacles)
    control = replace(
        s.control,
        speed=s.robot.speed,
        turn_rate=s.robot.turn_rate,
        turn_acceleration=s.robot.turn_acceleration,
    )
    return {
        "robot": make_turtlebot(s.robot, [*s.start, heading(s)]),
        "obstacles": obstacles,
        "noise": RandomSource(RandomDistribution.kGaussian, size(NOISE), PERIOD),
        "perception": Perception(s.perception),
        "goal": ConstantVectorSource(s.goal),
        "planner": make_planner(s),
        "control": UnicycleControl(control),
    }


def floor(scenario: NavigationScenario) -> list[float]:
    """Least x, least y, greatest x, greatest y [m] of what is worth seeing."""
    points = [scenario.start, scenario.goal]
    points += [[o.x, o.y] for o in discs(scenario)]
    xs, ys = zip(*points, strict=True)
    return [min(xs) - 1.5, min(ys) - 1.5, max(xs) + 1.5, max(ys) + 1.5]


def make_navigation_diagram(
    scenario: NavigationScenario, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram of a navigation.

    Args:
        scenario: The parameters.
        swaps: Systems that replace blocks of the same name and ports, for example
            `{"planner": MyPlanner()}`.

    Returns:
        The diagram, its signals exported as `model.signal`.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    builder = DiagramBuilder()
    scene_graph, arena = add_arena(
        builder,
        radii=[o.radius for o in discs(scenario)],
        radius=scenario.robot.radius,
        vision=scenario.perception.vision,
        goal=scenario.goal,
        floor=floor(scenario),
    )
    blocks = add_blocks(builder, make_blocks(scenario), swaps)
    systems = {"scene_graph": scene_graph, "arena": arena} | blocks
    return finish(builder, "navigation", systems, WIRES, EXPORTS, scenario.faults)
