"""The diagram of an operation: bedside, passive wrist, snake and organ in one."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import RandomSource

from diagrams.bedside.bedside import add_bedside
from diagrams.bedside.wrist import WRIST_EXPORTS, WRIST_WIRES, add_wrist
from diagrams.common.wiring import add_blocks, finish
from diagrams.gauze import diagram as gauze
from diagrams.gauze.theatre import add_theatre
from diagrams.keyhole.operation import KeyholeCase
from diagrams.keyhole.scenario import KeyholeScenario
from diagrams.snake.robot import DRUM_WIRES, WIRES, drum_chain
from plants.abdomen.organ_motion import add_organ_motion, organ_trajectory
from plants.instruments.tube import TubeParams, channel_frame
from plants.snake.snake import Snake, add_snake, set_default_posture
from plants.tissue.snake_in_organ import SnakeInOrgan
from plants.tissue.tissue_carver import Carving, TissueCarver
from systems.keyhole.phases import OperationPhases
from systems.keyhole.snake_load import SnakeLoad, weight_of
from systems.keyhole.snake_task import FAR, SnakeTask
from systems.keyhole.station_target import StationTarget
from systems.keyhole.tube_location import TubeLocation
from systems.keyhole.tube_task import TubeTask
from systems.motion.joint_commands import JointCommands
from systems.passive_wrist.sensor_zero import SensorZeroing
from systems.sensing.optical_tracker import OpticalTracker
from systems.sensing.organ_estimator import OrganEstimator
from systems.sensing.robot_location import RobotLocation

KEYHOLE_WIRES = (
    *(wire for wire in WRIST_WIRES if wire[1] != "wrench_watch.wrench"),
    ("wrist_sensor.mount", "sensor_zero.mount"),
    ("tool_wrench.wrench", "sensor_zero.wrench"),
    ("fulcrum_estimator.estimate", "sensor_zero.estimate"),
    ("sensor_zero.zeroed", "wrench_watch.wrench"),
    ("plant.pa10_state", "robot_location.arm_state"),
    ("passive_wrist.pivot", "robot_location.fulcrum"),
    ("plant.pa10_state", "joint_commands.arm_state"),
    ("passive_wrist.pivot", "joint_commands.fulcrum"),
    ("joint_commands.set_point", "plant.pa10_desired_state"),
    # The snake's weight shifts along the tube.
    ("snake_location.posture", "snake_load.posture"),
    ("snake_load.load", "tool_wrench.load"),
    # The organ: seen by the tracker, predicted.
    ("organ_shaft.y0", "organ_tracker.organ"),
    ("organ_noise.output", "organ_tracker.noise"),
    ("organ_tracker.organ_measured", "organ_estimator.measurement"),
    # The statechart.
    ("tube_task.status", "phases.tube"),
    ("snake_task.status", "phases.snake"),
    ("organ_estimator.motion", "phases.organ"),
    ("fulcrum_estimator.estimate", "phases.fulcrum"),
    ("tool_wrench.shaft", "phases.shaft"),
    ("wrench_watch.believed", "phases.wrench"),
    ("passive_wrist.permission", "phases.permission"),
    ("wire_watch.alarm", "phases.alarm"),
    ("snake_task.deviation", "phases.deviation"),
    # The tube follows the organ, through the passive wrist.
    ("phases.phase", "tube_task.phase"),
    ("organ_estimator.motion", "tube_task.organ"),
    ("snake_task.status", "tube_task.snake"),
    ("tube_task.tool", "passive_wrist.tool_wanted"),
    # The snake does the rest.
    ("plant.pa10_state", "tube_location.arm_state"),
    ("joint_commands.posture", "tube_location.posture"),
    ("joint_commands.next", "tube_location.next"),
    ("phases.phase", "snake_task.phase"),
    ("tube_location.tube", "snake_task.tube"),
    ("organ_estimator.ahead", "snake_task.organ"),
    ("snake_task.target", "resection_ik.target"),
    *WIRES,
    *DRUM_WIRES,
    # What is true of it in the organ.
    ("snake_location.posture", "snake_in_organ.posture"),
    ("wrist_sensor.mount", "snake_in_organ.mount"),
    ("organ_motion.y0", "snake_in_organ.entry"),
)

CARVER_WIRES = (
    ("snake_in_organ.posture_E", "tissue_carver.posture"),
    ("snake_task.cutting", "tissue_carver.cutting"),
)

EXPORTS = WRIST_EXPORTS | {
    "robot.tool": "robot_location.robot_tool",
    "joints.status": "joint_commands.status",
    "wrist.zero": "sensor_zero.zero",
    "wall.force": "wall_force.force",
    "wall.fulcrum_error": "wall_force.fulcrum_error",
    "operation.phase": "phases.phase",
    "operation.tube": "tube_task.status",
    "operation.snake": "snake_task.status",
    "organ.true": "organ_motion.y0",
    "organ.estimate": "organ_estimator.motion",
    "tip.reference": "snake_task.reference",
    "snake.deviation": "snake_task.deviation",
    "snake.tool": "snake_in_organ.tool",
    "snake.posture": "snake_location.bends",
    "snake.coupler_error": "snake_location.coupler_error",
    "ik.status": "resection_ik.status",
    "drums.limited": "wire_drums.limited",
    "watch.alarm": "wire_watch.alarm",
    "scene_graph.query": "scene_graph.query",
}

KEPT = ("joint_commands", "robot_location")
"""Blocks of a gauze delivery that are this diagram's own."""

PLANNER_WIRES = (
    ("organ_estimator.motion", "station_target.organ"),
    ("passive_wrist.permission", "tool_navigation.permission"),
    ("passive_wrist.permission", "clearance_constraint.permission"),
    ("tool_navigation.tool", "tube_task.planned"),
)


def theatre_wires(
    scenario: KeyholeScenario, blocks: Mapping[str, Any]
) -> tuple[list[tuple[str, str]], dict[str, str]]:
    """The wires of the surgeon's tools and the planner, and what is exported."""
    surgeon = scenario.surgeon
    wires, exports = gauze.wiring(surgeon, blocks)
    target = gauze.aliases(surgeon)["target.estimate"]
    own = {source for _, source in KEYHOLE_WIRES}
    led = [
        ("station_target.estimate" if source == target else source, sink)
        for source, sink in wires
        if sink not in own
        and not sink.startswith(("joint_commands.", "passive_wrist."))
        and (source, sink) not in WRIST_WIRES
    ]
    taken = {sink for _, sink in PLANNER_WIRES}
    led = [wire for wire in led if wire[1] not in taken]
    return [*led, *PLANNER_WIRES], exports


CARVER_EXPORTS = {
    "tissue.index": "tissue_carver.index",
    "tissue.removed": "tissue_carver.removed",
    "tissue.touched": "tissue_carver.touched",
    "tissue.way": "tissue_carver.way",
}


def known_tube(scenario: KeyholeScenario) -> TubeParams:
    """The tube as the controllers know it: retracted, the snake weighs at its end."""
    mass, _ = weight_of(scenario.operation.snake, scenario.operation.drive)
    return replace(scenario.instrument, gauze_mass=mass)


def make_blocks(case: KeyholeCase, posture: Any) -> dict[str, Any]:
    """The blocks of the diagram, by the names that the wires use.

    Args:
        case: The parameters and the plan.
        posture: Joint positions at the start (7) [rad].
    """
    s, o, snake = case.scenario, case.scenario.operation, case.scenario.in_tube
    task = SnakeTask(
        s.snake_task,
        o.snake,
        case.plan,
        (s.x_axis, s.axis),
        s.instrument.gap,
        s.tube_task.standoff,
    )
    start = task.inside
    phases = s.phases
    if case.resection is None:  # nothing is there that the body could touch
        phases = replace(phases, deviation=FAR)
    gravity = (s.R_WE.T @ [0.0, 0.0, -9.81]).tolist()
    tube_known = known_tube(s)
    blocks = {
        **drum_chain(o, snake, start, gravity=gravity),
        "snake_load": SnakeLoad(o.snake, o.drive, s.instrument),
        "sensor_zero": SensorZeroing(
            replace(s.sensor_zero, common=s.sensor_zero.common and s.joints.roll > 0.0),
            np.add(s.robot.p_WG, s.first_guess).tolist(),
            s.axis.tolist(),
        ),
        "organ_tracker": OpticalTracker(s.organ_tracker, ["organ"]),
        "organ_noise": RandomSource(
            RandomDistribution.kGaussian, 6, s.organ_tracker.period
        ),
        "organ_estimator": OrganEstimator(s.organ_estimator),
        "phases": OperationPhases(phases),
        "tube_task": TubeTask(s.tube_task, s.robot.p_WP, s.entry.p_WE, s.axis.tolist()),
        "snake_task": task,
        "tube_location": TubeLocation(
            tube_known, posture.tolist(), s.arm, s.joints.period
        ),
        "robot_location": RobotLocation(tube_known),
        "joint_commands": JointCommands(s.joints, posture.tolist(), s.arm, tube_known),
        "snake_in_organ": SnakeInOrgan(
            snake, s.instrument.length + s.instrument.gap, s.R_WE
        ),
    }
    if case.resection is not None:
        blocks["tissue_carver"] = TissueCarver(
            replace(o.carver, period=o.period),
            snake,
            Carving(case.session.volume, snake),
            start,
        )
    return blocks


def make_keyhole_diagram(
    case: KeyholeCase, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram of an operation through one trocar.

    Args:
        case: The parameters and the plan.
        swaps: Systems that replace blocks of the same name and ports.

    Returns:
        The diagram, its signals exported as `model.signal`.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    s = case.scenario
    builder = DiagramBuilder()
    added: list[Snake] = []

    def hang(plant: Any, tube: Any) -> list[Any]:
        frame = channel_frame(plant, tube, s.instrument)
        added.append(add_snake(plant, frame, s.in_tube, s.operation.drive))
        return [added[0].instance]

    bedside = add_bedside(builder, s, hang)
    plant = bedside.systems["plant"]
    own = make_blocks(case, bedside.posture)
    if s.others:
        add_theatre(builder, s.surgeon, bedside)
        planner = gauze.make_blocks(s.surgeon, bedside.posture)
        own |= {name: planner[name] for name in planner if name not in KEPT}
        own["station_target"] = StationTarget(s.tube_task.standoff, s.axis.tolist())
    blocks = add_blocks(builder, own, swaps)
    set_default_posture(plant, added[0], blocks["snake_task"].inside)
    motion = organ_trajectory(s.organ_motion, s.wall_motion, s.entry.p_WE, s.duration)
    source, shaft = add_organ_motion(builder, motion, s.axis)
    systems = bedside.systems | add_wrist(builder, bedside, s) | blocks
    systems |= {"organ_motion": source, "organ_shaft": shaft}
    wires, exports = KEYHOLE_WIRES, EXPORTS
    if case.resection is not None:
        wires, exports = wires + CARVER_WIRES, exports | CARVER_EXPORTS
    if s.others:
        more, shown = theatre_wires(s, systems)
        wires, exports = (*wires, *more), shown | exports
    return finish(builder, "keyhole", systems, wires, exports, s.faults)
