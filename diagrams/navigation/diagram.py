"""The diagram of a navigation: perception, planning, action (the thesis's Figure 1)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    RandomSource,
    ZeroOrderHold,
)

from diagrams.common.wiring import add_blocks, finish
from diagrams.navigation.scenario import (
    NavigationScenario,
    discs,
    driven,
    heading,
    mapping_params,
    walking,
)
from plants.crowd.crowd_motion import CrowdMotion
from plants.crowd.guided_disc import GuidedDisc, GuidedDiscParams, Place
from plants.crowd.obstacle_motion import ObstacleMotion, obstacle_at
from plants.crowd.walls import segments
from plants.turtlebot.arena import add_arena
from plants.turtlebot.lidar import SCAN_NOISE, Lidar
from plants.turtlebot.odometry import Odometry, OdometryNoise
from plants.turtlebot.signals import RobotState
from plants.turtlebot.turtlebot import make_turtlebot
from systems.common.outside import Outside
from systems.common.signal import size
from systems.perception.grid_mapping import SCAN_PERIOD, GridMapping
from systems.perception.tracking import Tracking
from systems.switching.classical_planner import ClassicalPlanner
from systems.switching.heading_law import UnicycleControlParams
from systems.switching.navigation_planner import PERIOD
from systems.switching.orca_planner import OrcaPlanner
from systems.switching.perception import Perception
from systems.switching.signals import NOISE
from systems.switching.statechart_planner import StatechartPlanner
from systems.switching.switching_planner import SwitchingPlanner
from systems.switching.unicycle_control import UnicycleControl

PERSON = 0.3
"""Radius [m] that whoever is seen by the legs is given."""
GIVEN = (
    # Perception: the obstacles within the disc of vision, and the true place.
    ("robot.y0", "perception.robot"),
    ("obstacles.obstacles", "perception.obstacles"),
    ("noise.output", "perception.noise"),
    ("perception.seen", "planner.seen"),
    ("robot.y0", "planner.robot"),
    ("robot.y0", "place_told.u"),
)
"""Perception that is told the truth, with noise at most."""
SENSED = (
    # The senses.
    ("robot.y0", "lidar.robot"),
    ("obstacles.obstacles", "lidar.obstacles"),
    ("lidar_noise.output", "lidar.noise"),
    ("robot.y0", "odometry.robot"),
    ("odometry_noise.output", "odometry.noise"),
    # Place and grid.
    ("odometry.reckoned", "mapping.reckoned"),
    ("lidar.scan", "mapping.scan"),
    ("tracking.moving", "mapping.moving"),
    # What moves, and what stands.
    ("mapping.place", "tracking.place"),
    ("lidar.scan", "tracking.scan"),
    ("mapping.grid", "tracking.grid"),
    ("tracking.seen", "planner.seen"),
    ("tracking.corners", "planner.corners"),
    ("mapping.place", "planner.robot"),
    ("mapping.place", "place_told.u"),
)
"""Perception by lidar and odometry."""
WIRES = (
    # Planning: one potential, one velocity.
    ("goal.y0", "planner.goal"),
    # Action: the velocity becomes speed and turn rate; it is told where the robot is
    # as often as the planner, and nothing of Python is asked between.
    ("place_told.y", "control.robot"),
    ("planner.v_R", "control.v_R"),
    ("planner.mode", "control.mode"),
    ("control.command", "robot.u0"),
    # What people see.
    ("robot.y0", "arena.robot"),
    ("obstacles.obstacles", "arena.obstacles"),
)
"""Every other signal of the diagram."""

EXPORTS = {
    "robot.state": "robot.y0",
    "obstacles.rows": "obstacles.obstacles",
    "planner.v_R": "planner.v_R",
    "planner.mode": "planner.mode",
    "control.command": "control.command",
    "scene_graph.query": "scene_graph.query",
}
"""What can be logged, and drawn."""
SENSED_EXPORTS = {
    "lidar.scan": "lidar.scan",
    "mapping.place": "mapping.place",
    "mapping.sureness": "mapping.sureness",
    "tracking.moving": "tracking.moving",
}
"""What else, where the robot sees for itself."""


PEERS: dict[str, Callable[[Any], Any]] = {
    "classical": ClassicalPlanner,
    "orca": OrcaPlanner,
    "statechart": StatechartPlanner,
}
"""Planners that need no more of the scenario than their own part."""


def control_params(scenario: NavigationScenario) -> UnicycleControlParams:
    """Of the wheels' control; its limits are the robot's."""
    robot = scenario.robot
    return replace(
        scenario.control,
        speed=robot.speed,
        turn_rate=robot.turn_rate,
        turn_acceleration=robot.turn_acceleration,
    )


def make_planner(scenario: NavigationScenario) -> Any:
    """The planner that the scenario names; its body and limits are the robot's."""
    radius, speed = scenario.robot.radius, scenario.robot.speed
    params = getattr(scenario, scenario.planner)  # each has a part of its name
    params = replace(params, body_radius=radius, speed=speed)
    if scenario.planner in PEERS:
        return PEERS[scenario.planner](params)
    switching = replace(
        params,
        vision=scenario.perception.vision,
        braking=scenario.robot.acceleration,
        # What stands must not seem to move by the noise of its measured velocity.
        standing_speed=max(
            scenario.switching.standing_speed, 3.0 * scenario.perception.velocity_noise
        ),
    )
    return SwitchingPlanner(switching, control=control_params(scenario))


def gaussian(signal: Any, period: float = PERIOD) -> Any:
    """A source of the standard normal numbers of a signal, every period [s]."""
    return RandomSource(RandomDistribution.kGaussian, size(signal), period)


def given_blocks(scenario: NavigationScenario) -> dict[str, Any]:
    """Perception that is told the truth."""
    return {"noise": gaussian(NOISE), "perception": Perception(scenario.perception)}


def sense_blocks(scenario: NavigationScenario) -> dict[str, Any]:
    """Senses, and the perception that makes something of them."""
    s = scenario
    mapping = mapping_params(s)
    tracking = replace(s.tracking, vision=s.perception.vision)
    if s.lidar.legs:
        tracking = replace(tracking, person=s.tracking.person or PERSON)
    return {
        "lidar_noise": gaussian(SCAN_NOISE, SCAN_PERIOD),
        "lidar": Lidar(s.lidar, segments(s.walls)),
        "odometry_noise": gaussian(OdometryNoise),
        "odometry": Odometry(s.odometry),
        "mapping": GridMapping(mapping),
        "tracking": Tracking(tracking, mapping),
    }


def make_blocks(scenario: NavigationScenario) -> dict[str, Any]:
    """The blocks of the diagram, by the names that `WIRES` uses."""
    s = scenario
    if s.crowd.people:
        obstacles: Any = CrowdMotion(s.crowd, s.robot.radius)
    else:
        obstacles = ObstacleMotion(walking(s))
    driver: dict[str, Any] = {}
    if (row := driven(s)) is not None:
        first = obstacle_at(s.obstacles[row], 0.0)
        start = Place(first.x, first.y)
        told = Outside(Place, start, s.obstacles[row].guided, PERIOD)
        disc = GuidedDisc(GuidedDiscParams(period=PERIOD), start, row)
        driver = {"obstacle_outside": told, "driven": disc}
    return {
        "robot": make_turtlebot(s.robot, [*s.start, heading(s)]),
        "obstacles": obstacles,
        **driver,
        **(sense_blocks(s) if s.senses == "lidar" else given_blocks(s)),
        "goal": ConstantVectorSource(s.goal),
        "planner": make_planner(s),
        "place_told": ZeroOrderHold(PERIOD, size(RobotState)),
        "control": UnicycleControl(control_params(s)),
    }


def floor(scenario: NavigationScenario) -> list[float]:
    """Least x, least y, greatest x, greatest y [m] of what is worth seeing."""
    points = [scenario.start, scenario.goal]
    points += [point for wall in scenario.walls for point in wall.points]
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
        walls=scenario.walls,
    )
    blocks = add_blocks(builder, make_blocks(scenario), swaps)
    systems = {"scene_graph": scene_graph, "arena": arena} | blocks
    sensed = scenario.senses == "lidar"
    wires = [*(SENSED if sensed else GIVEN), *WIRES]
    if scenario.crowd.people:
        wires.append(("robot.y0", "obstacles.robot"))
    exports = EXPORTS | (SENSED_EXPORTS if sensed else {})
    if driven(scenario) is not None:
        given, true = "obstacles.obstacles", "driven.obstacles"
        wires = [(true if source == given else source, sink) for source, sink in wires]
        wires += [(given, "driven.others"), ("obstacle_outside.told", "driven.wanted")]
        exports["obstacles.rows"] = true
    return finish(builder, "navigation", systems, wires, exports, scenario.faults)
