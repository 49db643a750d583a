"""The diagram of a gauze delivery: the paper's Figures 2 and 4 in blocks and wires."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, RandomSource

from diagrams.bedside.wrist import WRIST_EXPORTS, WRIST_WIRES, add_wrist
from diagrams.common.wiring import add_blocks, finish, has_input, has_output
from diagrams.gauze.scenario import GauzeScenario
from diagrams.gauze.theatre import add_theatre
from plants.surgeon.hunting_tool import HuntingTool
from plants.surgeon.surgeon_tool import SurgeonTool
from systems.auto_guidance.backward_movement import BackwardMovement
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiter
from systems.auto_guidance.go_to_target import GoToTarget
from systems.auto_guidance.velocity_corrections import VelocityCorrections
from systems.bypass.clearance_constraint import ClearanceConstraint
from systems.bypass.tool_bypass import ToolBypass
from systems.motion.endoscope import Endoscope
from systems.motion.joint_commands import JointCommands
from systems.motion.tool_navigation import ToolNavigation
from systems.sensing.optical_tracker import OpticalTracker
from systems.sensing.robot_location import RobotLocation
from systems.sensing.trajectory_estimator import TrajectoryEstimator

WIRES = (
    # The surgeon's tools are seen by the tracker; estimators make sense of it.
    ("target_tool.shaft", "optical_tracker.S"),
    ("obstacle_tool.shaft", "optical_tracker.O"),
    ("tracker_noise.output", "optical_tracker.noise"),
    ("optical_tracker.S_measured", "target_estimator.measurement"),
    ("optical_tracker.O_measured", "obstacle_estimator.measurement"),
    # The camera follows S and gives the view cone.
    ("target_estimator.estimate", "endoscope.target"),
    # Figure 2's feedback: where the robot's tool is.
    ("plant.pa10_state", "robot_location.arm_state"),
    ("fulcrum.y0", "robot_location.fulcrum"),
    # Figure 4, the local planner: three behaviours and the fuzzy decision.
    ("robot_location.robot_tool", "go_to_target.robot_tool"),
    ("obstacle_estimator.estimate", "go_to_target.obstacle"),
    ("target_estimator.estimate", "go_to_target.target"),
    ("go_to_target.v1", "velocity_corrections.v1"),
    ("go_to_target.guide", "velocity_corrections.guide"),
    ("obstacle_estimator.estimate", "velocity_corrections.obstacle"),
    ("go_to_target.guide", "backward_movement.guide"),
    ("obstacle_estimator.estimate", "backward_movement.obstacle"),
    ("go_to_target.v1", "fuzzy_arbiter.v1"),
    ("velocity_corrections.v2", "fuzzy_arbiter.v2"),
    ("backward_movement.v3", "fuzzy_arbiter.v3"),
    ("go_to_target.guide", "fuzzy_arbiter.guide"),
    ("robot_location.robot_tool", "fuzzy_arbiter.robot_tool"),
    ("obstacle_estimator.estimate", "fuzzy_arbiter.obstacle"),
    ("target_estimator.estimate", "fuzzy_arbiter.target"),
    # The hard clearance to O, to S's own shaft and to the endoscope.
    ("fuzzy_arbiter.v_R", "clearance_constraint.v_R"),
    ("go_to_target.guide", "clearance_constraint.guide"),
    ("robot_location.robot_tool", "clearance_constraint.robot_tool"),
    ("obstacle_estimator.estimate", "clearance_constraint.obstacle"),
    ("target_estimator.estimate", "clearance_constraint.target"),
    ("endoscope.estimate", "clearance_constraint.camera"),
    ("endoscope.view_cone", "clearance_constraint.view_cone"),
    # The guide point's velocity becomes tool motion, then joint motion.
    ("clearance_constraint.v_safe", "tool_navigation.v_R"),
    ("go_to_target.guide", "tool_navigation.guide"),
    ("robot_location.robot_tool", "tool_navigation.robot_tool"),
    ("obstacle_estimator.estimate", "tool_navigation.obstacle"),
    ("target_estimator.estimate", "tool_navigation.target"),
    ("endoscope.view_cone", "tool_navigation.view_cone"),
    ("tool_navigation.tool", "joint_commands.tool"),
    ("joint_commands.set_point", "plant.pa10_desired_state"),
    # What people hold in their hands moves the bodies of the scene.
    ("target_tool.shaft", "posed_tools.S"),
    ("obstacle_tool.shaft", "posed_tools.O"),
    ("endoscope.shaft", "posed_tools.C"),
)
"""Every signal of the diagram but the plant's own, the fulcrum known."""

TOLD = (
    ("fulcrum.y0", "robot_location.fulcrum"),
    ("tool_navigation.tool", "joint_commands.tool"),
)
"""The wires that the passive wrist takes the place of."""

EMULATED = (
    *WRIST_WIRES,
    ("passive_wrist.pivot", "robot_location.fulcrum"),
    ("tool_navigation.tool", "passive_wrist.tool_wanted"),
    ("passive_wrist.permission", "tool_navigation.permission"),
    ("passive_wrist.permission", "clearance_constraint.permission"),
)
"""Figure 2's passive wrist emulation between the local planner and the arm."""

EXTRA_WIRES = (
    ("endoscope.estimate", "go_to_target.camera"),
    ("endoscope.view_cone", "go_to_target.view_cone"),
    ("robot_location.robot_tool", "obstacle_tool.robot_tool"),
)
"""Wires to inputs that only some forms of a block have: the bypass, a hunting tool."""

EXPORTS = {
    "robot.tool": "robot_location.robot_tool",
    "target.shaft": "target_tool.shaft",
    "obstacle.shaft": "obstacle_tool.shaft",
    "obstacle.tip_velocity": "obstacle_tool.tip_velocity",
    "target.estimate": "target_estimator.estimate",
    "obstacle.estimate": "obstacle_estimator.estimate",
    "camera.shaft": "endoscope.shaft",
    "camera.view_cone": "endoscope.view_cone",
    "planner.guide": "go_to_target.guide",
    "planner.v1": "go_to_target.v1",
    "planner.v2": "velocity_corrections.v2",
    "planner.v3": "backward_movement.v3",
    "planner.weights": "fuzzy_arbiter.weights",
    "planner.v_R": "fuzzy_arbiter.v_R",
    "planner.v_safe": "clearance_constraint.v_safe",
    "planner.clearance": "clearance_constraint.status",
    "navigation.tool": "tool_navigation.tool",
    "navigation.stop": "tool_navigation.stop",
    "joints.posture": "joint_commands.posture",
    "joints.status": "joint_commands.status",
    "clearance": "clearance.clearance",
    "wall.force": "wall_force.force",
    "wall.fulcrum_error": "wall_force.fulcrum_error",
    "scene_graph.query": "scene_graph.query",
}
"""What can be logged, and drawn."""

EXTRA_EXPORTS = {"planner.way": "go_to_target.way"}
"""Outputs that only the bypass has."""


def make_blocks(scenario: GauzeScenario, posture: Any) -> dict[str, Any]:
    """The blocks of the diagram, by the names that `WIRES` uses.

    Args:
        scenario: The parameters.
        posture: Joint positions at the start (7) [rad].
    """
    s = scenario
    target = replace(s.target, tremor_seed=2 * s.seed)
    obstacle = replace(s.obstacle, tremor_seed=2 * s.seed + 1)
    if s.recording:
        obstacle.recording = s.recording
    estimators = [
        replace(
            s.estimator,
            body=s.tracker.body,  # the estimators know the tracker they listen to
            period=s.tracker.period,
            fulcrum=tool.p_WG if s.known_fulcrums else None,
        )
        for tool in (target, obstacle)
    ]
    # The planner knows the limits of the navigation behind it.
    around = (s.margins, s.navigation, s.workspace)
    blocks = {
        "target_tool": SurgeonTool(target),
        "obstacle_tool": HuntingTool(obstacle, s.hunt)
        if s.hunt.speed
        else SurgeonTool(obstacle),
        "optical_tracker": OpticalTracker(s.tracker),
        "tracker_noise": RandomSource(
            RandomDistribution.kGaussian, 12, s.tracker.period
        ),
        "target_estimator": TrajectoryEstimator(estimators[0]),
        "obstacle_estimator": TrajectoryEstimator(estimators[1]),
        "endoscope": Endoscope(s.camera),
        "robot_location": RobotLocation(s.instrument),
        "go_to_target": ToolBypass(s.tool_bypass, *around)
        if s.behaviour == "bypass"
        else GoToTarget(s.go_to_target),
        "velocity_corrections": VelocityCorrections(s.velocity_corrections),
        "backward_movement": BackwardMovement(s.backward_movement),
        "fuzzy_arbiter": FuzzyArbiter(s.fuzzy_arbiter),
        "clearance_constraint": ClearanceConstraint(s.clearance_constraint, *around),
        "tool_navigation": ToolNavigation(s.navigation, s.robot.p_WP, s.robot.p_WG),
        "joint_commands": JointCommands(s.joints, posture, s.arm, s.instrument),
    }
    if not s.emulated:
        blocks["fulcrum"] = ConstantVectorSource(s.robot.p_WG)
    return blocks


def make_gauze_diagram(
    scenario: GauzeScenario, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram of a gauze delivery.

    Args:
        scenario: The parameters.
        swaps: Systems that replace blocks of the same name and ports, for example
            `{"go_to_target": MyPlanner()}`.

    Returns:
        The diagram, its signals exported as `model.signal`.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    builder = DiagramBuilder()
    theatre = add_theatre(builder, scenario)
    blocks = add_blocks(builder, make_blocks(scenario, theatre.posture), swaps)
    systems = theatre.systems | blocks
    wires, exports = [*WIRES], {**EXPORTS}
    if scenario.emulated:
        systems |= add_wrist(builder, theatre, scenario)
        wires = [*(w for w in WIRES if w not in TOLD), *EMULATED]
        exports |= WRIST_EXPORTS
    wires += [w for w in EXTRA_WIRES if has_input(systems, w[1])]
    exports |= {k: v for k, v in EXTRA_EXPORTS.items() if has_output(systems, v)}
    return finish(builder, "gauze_delivery", systems, wires, exports)
