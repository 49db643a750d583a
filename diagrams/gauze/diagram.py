"""The diagram of a gauze delivery: the paper's Figures 2 and 4 in blocks and wires."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Multiplexer,
    RandomSource,
)

from diagrams.bedside.wrist import add_wrist, unbent, wrist_exports, wrist_wires
from diagrams.common.wiring import add_blocks, finish, has_input, has_output
from diagrams.gauze import contact
from diagrams.gauze import organs as inside
from diagrams.gauze.scenario import GauzeScenario
from diagrams.gauze.theatre import add_theatre
from diagrams.gauze.tools import OBSTACLE, HandTool, hands
from plants.organs.organs import OrganSet
from plants.surgeon.guided_tool import GuidedTool
from plants.surgeon.hunting_tool import HuntingTool
from plants.surgeon.surgeon_tool import Patient, SurgeonTool
from plants.surgeon.tracked_tool import Sighting, TrackedTool, unsighted
from systems.auto_guidance.backward_movement import BackwardMovement
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiter
from systems.auto_guidance.go_to_target import GoToTarget
from systems.auto_guidance.velocity_corrections import VelocityCorrections
from systems.bypass.clearance_constraint import ClearanceConstraint
from systems.bypass.tool_bypass import ToolBypass
from systems.common.outside import Outside
from systems.common.signal import size, vector
from systems.common.signals import Estimate, Point
from systems.motion.camera_planner import CameraPlanner
from systems.motion.endoscope import Endoscope
from systems.motion.joint_commands import JointCommands
from systems.motion.tool_navigation import ToolNavigation
from systems.sensing.optical_tracker import OpticalTracker
from systems.sensing.registration import Registration
from systems.sensing.robot_location import RobotLocation
from systems.sensing.tool_wrench import told_instrument
from systems.sensing.trajectory_estimator import TrajectoryEstimator

WIRES = (
    # The camera follows S and gives the view cone.
    ("target.estimate", "endoscope.target"),
    # Figure 2's feedback: where the robot's tool is.
    ("plant.pa10_state", "robot_location.arm_state"),
    ("plant.pa10_state", "joint_commands.arm_state"),
    ("fulcrum.y0", "robot_location.fulcrum"),
    ("fulcrum.y0", "joint_commands.fulcrum"),
    # Figure 4, the local planner: three behaviours and the fuzzy decision.
    ("robot_location.robot_tool", "go_to_target.robot_tool"),
    ("obstacles.estimates", "go_to_target.obstacles"),
    ("target.estimate", "go_to_target.target"),
    ("go_to_target.v1", "velocity_corrections.v1"),
    ("go_to_target.guide", "velocity_corrections.guide"),
    ("obstacles.estimates", "velocity_corrections.obstacles"),
    ("go_to_target.guide", "backward_movement.guide"),
    ("obstacles.estimates", "backward_movement.obstacles"),
    ("go_to_target.v1", "fuzzy_arbiter.v1"),
    ("velocity_corrections.v2", "fuzzy_arbiter.v2"),
    ("backward_movement.v3", "fuzzy_arbiter.v3"),
    ("go_to_target.guide", "fuzzy_arbiter.guide"),
    ("robot_location.robot_tool", "fuzzy_arbiter.robot_tool"),
    ("obstacles.estimates", "fuzzy_arbiter.obstacles"),
    ("target.estimate", "fuzzy_arbiter.target"),
    # The hard clearance to the obstacles, to S's own shaft and to the endoscope.
    ("fuzzy_arbiter.v_R", "clearance_constraint.v_R"),
    ("go_to_target.guide", "clearance_constraint.guide"),
    ("robot_location.robot_tool", "clearance_constraint.robot_tool"),
    ("obstacles.estimates", "clearance_constraint.obstacles"),
    ("target.estimate", "clearance_constraint.target"),
    ("endoscope.estimate", "clearance_constraint.camera"),
    ("endoscope.view_cone", "clearance_constraint.view_cone"),
    # The guide point's velocity becomes tool motion, then joint motion.
    ("clearance_constraint.v_safe", "tool_navigation.v_R"),
    ("clearance_constraint.status", "tool_navigation.clearance"),
    ("go_to_target.guide", "tool_navigation.guide"),
    ("robot_location.robot_tool", "tool_navigation.robot_tool"),
    ("obstacles.estimates", "tool_navigation.obstacles"),
    ("target.estimate", "tool_navigation.target"),
    ("endoscope.view_cone", "tool_navigation.view_cone"),
    ("tool_navigation.tool", "joint_commands.tool"),
    ("joint_commands.set_point", "plant.pa10_desired_state"),
)
"""Every signal but the plant's own and those of `tool_wires`, the fulcrum known.

`target` is S's estimator, whatever S is called; `obstacles` the others' together.
"""


def tool_wires(scenario: GauzeScenario) -> list[tuple[str, str]]:
    """The wires of the surgeon's tools: seen by the tracker, made sense of, shown."""
    wires = [
        ("tracker_noise.output", "optical_tracker.noise"),
        ("endoscope.shaft", f"posed_tools.{scenario.camera.name}"),
        ("endoscope.shaft", f"clearance.{scenario.camera.name}"),
    ]
    for name, tool in hands(scenario.tools, scenario.seed).items():
        shaft = contact.shaft_port(scenario, name)
        shown = shaft if tool.tracked is None else f"{name}_tool.shown"
        wires += [
            (shown, f"optical_tracker.{name}"),
            *seen(name, scenario.registration.active),
            (shaft, f"posed_tools.{name}"),
            (shaft, f"clearance.{name}"),
        ]
        if tool.hunt.speed:
            wires.append(("robot_location.robot_tool", f"{name}_tool.robot_tool"))
        if tool.tracked is not None:
            wires.append((f"{name}_outside.told", f"{name}_tool.sighting"))
        elif tool.guided is not None:
            wires.append((f"{name}_outside.told", f"{name}_tool.wanted"))
    if len(scenario.obstacles) > 1:
        wires += [
            (f"{tool.name}_estimator.estimate", f"obstacle_estimates.u{index}")
            for index, tool in enumerate(scenario.obstacles)
        ]
    return wires


def seen(name: str, registered: bool) -> list[tuple[str, str]]:
    """The wires from the tracker to a tool's estimator."""
    measured, wanted = (
        f"optical_tracker.{name}_measured",
        f"{name}_estimator.measurement",
    )
    if not registered:
        return [(measured, wanted)]
    mended = f"registration.{name}"
    return [
        (measured, f"{mended}_measured"),
        (mended, wanted),
        ("registration.alignment", f"{name}_estimator.alignment"),
    ]


REGISTERED = (
    ("marker_shaft.shaft", "optical_tracker.robot"),
    ("optical_tracker.robot_measured", "registration.robot_measured"),
    ("plant.pa10_state", "registration.arm_state"),
)
"""The tracker sees the robot's own tool as well."""

KEPT_CLEAR = ("clearance_constraint.status", "joint_commands.clearance")
"""Where R must touch no tool, its tip does not lag near one."""

TOLD = (
    ("fulcrum.y0", "robot_location.fulcrum"),
    ("fulcrum.y0", "joint_commands.fulcrum"),
    ("tool_navigation.tool", "joint_commands.tool"),
)
"""The wires that the passive wrist takes the place of."""

EMULATED = (
    ("passive_wrist.pivot", "robot_location.fulcrum"),
    ("passive_wrist.pivot", "joint_commands.fulcrum"),
    ("tool_navigation.tool", "passive_wrist.tool_wanted"),
    ("passive_wrist.permission", "tool_navigation.permission"),
    ("passive_wrist.permission", "clearance_constraint.permission"),
    # The probe swings the shaft where it is outside the body.
    ("tool_navigation.leeway", "passive_wrist.leeway"),
)
"""Figure 2's passive wrist emulation between the local planner and the arm."""

EXTRA_WIRES = (("endoscope.estimate", "go_to_target.camera"),)
"""Wires to inputs that only the bypass has, besides what the endoscope sees."""

SEEING = (
    ("robot_location.robot_tool", "endoscope.robot_tool"),
    ("obstacles.estimates", "endoscope.obstacles"),
)
"""Wires to a camera that plans."""

EXPORTS = {
    "robot.tool": "robot_location.robot_tool",
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


def tool_exports(scenario: GauzeScenario) -> dict[str, str]:
    """The tools' share of what can be logged: `NAME.shaft`, `NAME.estimate`, ..."""
    exports: dict[str, str] = {}
    for name in hands(scenario.tools, scenario.seed):
        exports |= {
            f"{name}.shaft": contact.shaft_port(scenario, name),
            f"{name}.tip_velocity": f"{name}_tool.tip_velocity",
            f"{name}.estimate": f"{name}_estimator.estimate",
        }
    camera = scenario.camera.name
    return exports | {
        f"{camera}.shaft": "endoscope.shaft",
        f"{camera}.view_cone": "endoscope.view_cone",
    }


EXTRA_EXPORTS = {"planner.way": "go_to_target.way"}
"""Outputs that only the bypass has."""


def make_tool(tool: HandTool, scenario: GauzeScenario) -> Any:
    """The block of a tool in the surgeon's hand."""
    if tool.tracked is not None:
        return TrackedTool()
    if tool.guided is not None:
        return GuidedTool(tool)
    if tool.hunt.speed:
        return HuntingTool(tool, tool.hunt)
    patient = Patient(scenario.wall_motion.excursion, scenario.duration)
    return SurgeonTool(tool, patient)


def make_outside(tool: HandTool) -> Any:
    """What tells a tool where it is, or is wanted, from outside; None if nothing."""
    if tool.tracked is not None:
        return Outside(Sighting, unsighted(tool), tool.tracked)
    if tool.guided is not None:
        return Outside(Point, Point(vector(tool.points[0])), tool.guided)
    return None


def aliases(scenario: GauzeScenario) -> dict[str, str]:
    """What `WIRES` calls the estimates: output by name, whatever the tools' names."""
    known = [f"{tool.name}_estimator.estimate" for tool in scenario.obstacles]
    together = "obstacle_estimates.y0" if len(known) > 1 else known[0]
    return {
        "target.estimate": f"{scenario.target.name}_estimator.estimate",
        "obstacles.estimates": together,
    }


def make_blocks(
    scenario: GauzeScenario, posture: Any, organs: OrganSet | None = None
) -> dict[str, Any]:
    """The blocks of the diagram, by the names that `WIRES` uses.

    Args:
        scenario: The parameters.
        posture: Joint positions at the start (7) [rad].
        organs: What blocks get of the organs; None without any.
    """
    s = scenario
    tools = hands(s.tools, s.seed)
    obstacles = [name for name, tool in tools.items() if tool.role == OBSTACLE]
    shown = [*tools, "robot"] if s.registration.active else [*tools]
    # The planner knows the limits of the navigation behind it.
    around = (s.margins, s.navigation, s.workspace)
    blocks: dict[str, Any] = {
        "optical_tracker": OpticalTracker(s.tracker, shown),
        "tracker_noise": RandomSource(
            RandomDistribution.kGaussian, 6 * len(shown), s.tracker.period
        ),
        "endoscope": CameraPlanner(s.camera_planner, s.camera, obstacles, organs)
        if s.camera_planner.active
        else Endoscope(s.camera),
        "robot_location": RobotLocation(s.instrument, s.shaft_bend.active),
        "go_to_target": ToolBypass(s.tool_bypass, *around, obstacles, organs)
        if s.behaviour == "bypass"
        else GoToTarget(s.go_to_target, obstacles),
        "velocity_corrections": VelocityCorrections(s.velocity_corrections, obstacles),
        "backward_movement": BackwardMovement(s.backward_movement, obstacles),
        "fuzzy_arbiter": FuzzyArbiter(s.fuzzy_arbiter, obstacles),
        "clearance_constraint": ClearanceConstraint(
            s.clearance_constraint, *around, obstacles, organs
        ),
        "tool_navigation": ToolNavigation(
            s.navigation, s.robot.p_WP, s.robot.p_WG, obstacles
        ),
        "joint_commands": JointCommands(
            s.joints, posture, s.arm, told_instrument(s.tool_wrench, s.instrument)
        ),
    }
    for name, tool in tools.items():
        blocks[f"{name}_tool"] = make_tool(tool, s)
        if outside := make_outside(tool):
            blocks[f"{name}_outside"] = outside
        blocks[f"{name}_estimator"] = TrajectoryEstimator(
            replace(
                s.estimator,
                body=s.tracker.body,  # it knows the tracker that it listens to
                period=s.tracker.period,
                fulcrum=tool.p_WG if s.known_fulcrums else None,
            )
        )
    if len(obstacles) > 1:
        blocks["obstacle_estimates"] = Multiplexer([size(Estimate)] * len(obstacles))
    if s.registration.active:
        blocks["registration"] = Registration(
            replace(s.registration, period=s.tracker.period),
            list(tools),
            s.tracker.body,
            s.instrument,
        )
    if not s.emulated:
        blocks["fulcrum"] = ConstantVectorSource(s.robot.p_WG)
    return blocks


def wiring(
    scenario: GauzeScenario, systems: Mapping[str, Any]
) -> tuple[list[tuple[str, str]], dict[str, str]]:
    """All wires between the systems, and what is exported of them.

    Args:
        scenario: The parameters.
        systems: Plant and blocks by their names.
    """
    wires = [*WIRES, *tool_wires(scenario), *contact.wires(scenario)]
    exports = EXPORTS | tool_exports(scenario) | contact.exports(scenario)
    if scenario.emulated:
        wires = [
            *(wire for wire in wires if wire not in TOLD),
            *EMULATED,
            *wrist_wires(scenario),
        ]
        exports |= wrist_exports(scenario)
    wires = contact.yielding(scenario, wires)
    if scenario.clearance_constraint.active:
        wires.append(KEPT_CLEAR)
    if scenario.registration.active:
        wires += REGISTERED
        exports |= {"tracker.alignment": "registration.alignment"}
    if scenario.organs:
        wires = inside.wired(scenario, wires)
        wires = [wire for wire in wires if has_input(systems, wire[1])]
        exports |= inside.EXPORTS | (
            inside.PRESS_EXPORTS if scenario.press.active else {}
        )
    if scenario.camera_planner.active:
        wires += SEEING
        exports["camera.sight"] = "endoscope.sight"
        ahead = ("endoscope.next_view", "go_to_target.view_cone")
    else:
        ahead = ("endoscope.view_cone", "go_to_target.view_cone")
    wires += [w for w in (*EXTRA_WIRES, ahead) if has_input(systems, w[1])]
    exports |= {k: v for k, v in EXTRA_EXPORTS.items() if has_output(systems, v)}
    wires = unbent(scenario, wires)
    known = aliases(scenario)
    return [(known.get(source, source), sink) for source, sink in wires], exports


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
    organs = inside.known_organs(scenario)
    made = make_blocks(scenario, theatre.posture, organs)
    blocks = add_blocks(builder, made, swaps)
    systems = theatre.systems | blocks
    systems |= contact.add_contact(builder, scenario, theatre, blocks)
    if organs is not None:
        systems |= inside.add_organs(builder, scenario, theatre, organs)
    if scenario.emulated:
        systems |= add_wrist(builder, theatre, scenario)
    systems |= contact.add_yield(builder, scenario)
    if organs is not None and scenario.press.active:
        systems |= inside.add_press(builder, scenario, organs)
    wires, exports = wiring(scenario, systems)
    return finish(builder, "gauze_delivery", systems, wires, exports, scenario.faults)
