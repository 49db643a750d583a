"""The diagram of a wrist study: Figure 2 with a scripted task as its planner."""

from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import DiagramBuilder

from diagrams.bedside.bedside import add_bedside
from diagrams.bedside.wrist import add_wrist, unbent, wrist_exports, wrist_wires
from diagrams.common.wiring import add_blocks, finish
from diagrams.wrist.scenario import WristScenario
from systems.common.outside import Outside
from systems.common.signal import vector
from systems.common.signals import Point
from systems.motion.joint_commands import JointCommands
from systems.passive_wrist.arc_navigation import ArcNavigation
from systems.passive_wrist.hand_navigation import HandNavigation
from systems.sensing.robot_location import RobotLocation
from systems.sensing.tool_wrench import told_instrument

WIRES = (
    # The task plans its arcs about the fulcrum that the wrist turns about.
    ("passive_wrist.pivot", "arc_navigation.fulcrum"),
    ("passive_wrist.permission", "arc_navigation.permission"),
    ("arc_navigation.tool", "passive_wrist.tool_wanted"),
    ("joint_commands.set_point", "plant.pa10_desired_state"),
    ("plant.pa10_state", "robot_location.arm_state"),
    ("plant.pa10_state", "joint_commands.arm_state"),
    ("passive_wrist.pivot", "robot_location.fulcrum"),
    ("passive_wrist.pivot", "joint_commands.fulcrum"),
)

LED = ("tip_outside.told", "arc_navigation.wanted")
"""The wire of a hand that leads the tip in the script's place."""

EXPORTS = {
    "robot.tool": "robot_location.robot_tool",
    "navigation.tool": "arc_navigation.tool",
    "joints.status": "joint_commands.status",
    "wall.force": "wall_force.force",
    "wall.fulcrum_error": "wall_force.fulcrum_error",
    "scene_graph.query": "scene_graph.query",
}


def make_wrist_diagram(
    scenario: WristScenario, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram.

    Args:
        scenario: The parameters.
        swaps: Systems that replace blocks of the same name and ports.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    builder = DiagramBuilder()
    bedside = add_bedside(builder, scenario)
    robot = scenario.robot
    guess = [p + e for p, e in zip(robot.p_WG, scenario.first_guess, strict=True)]
    is_led = scenario.guided is not None
    navigation: Any = ArcNavigation(scenario.arcs, robot.p_WP, guess)
    led: dict[str, Any] = {}
    if is_led:
        navigation = HandNavigation(scenario.hand, robot.p_WP, guess)
        rest = Point(vector(robot.p_WP))
        led = {"tip_outside": Outside(Point, rest, scenario.guided)}
    blocks = add_blocks(
        builder,
        led
        | {
            "arc_navigation": navigation,
            "joint_commands": JointCommands(
                scenario.joints,
                bedside.posture.tolist(),
                scenario.arm,
                told_instrument(scenario.tool_wrench, scenario.instrument),
            ),
            "robot_location": RobotLocation(
                scenario.instrument, scenario.shaft_bend.active
            ),
        },
        swaps,
    )
    systems = bedside.systems | add_wrist(builder, bedside, scenario) | blocks
    return finish(
        builder,
        "passive_wrist",
        systems,
        unbent(scenario, [*WIRES, *wrist_wires(scenario), *([LED] if is_led else [])]),
        EXPORTS | wrist_exports(scenario),
        scenario.faults,
    )
