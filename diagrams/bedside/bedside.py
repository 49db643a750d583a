"""The robot at the bedside: arm, instrument and abdomen in one continuous plant."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.multibody.tree import ForceElementIndex, LinearBushingRollPitchYaw

from plants.abdomen.abdomen import Abdomen, add_abdomen, seat_sleeve
from plants.abdomen.scenery import add_scenery
from plants.abdomen.wall_force import add_wall_force
from plants.abdomen.wall_motion import WallMotionParams, add_wall_motion
from plants.arm.arm import add_arm
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import BASE_POSITION
from plants.arm.posture import home_posture
from plants.common.actuation import hold_still
from plants.common.scene import add_plant_and_scene, connect_poses
from plants.instruments.instrument import Instrument, add_instrument
from plants.instruments.tip_push import TipPushParams, add_tip_push
from plants.instruments.tool_shaft import add_tool_shaft
from plants.instruments.tube import TubeParams, add_tube
from systems.common.parameter import parameter


@dataclass
class ToolAtStart:
    """Where the robot's own tool R is at the start, in W."""

    p_WG: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "its true fulcrum G_R, the wall at rest",
        "m",
        least=-0.5,
        most=0.5,
        shape=(3,),
    )
    p_WP: list[float] = parameter(
        [0.0, 0.0, -0.1], "its tip", "m", least=-0.5, most=0.5, shape=(3,)
    )


THIN = (add_instrument, 0.0042)
"""What adds an instrument, and the radius of its trocar in m."""


@dataclass
class Bedside:
    """What `add_bedside` added.

    Attributes:
        systems: By the names that wires use.
        posture: Joint positions at the start (7) [rad].
        instrument: The robot's instrument.
        abdomen: The abdomen.
        below: Model instances of all that hangs on the wrist's sensor.
        held: The surgeon's tools that have contact with the robot's, by their names.
    """

    systems: dict[str, Any]
    posture: np.ndarray
    instrument: Instrument
    abdomen: Abdomen
    below: list[Any]
    held: dict[str, Any] = field(default_factory=dict)


def add_bedside(
    builder: Any,
    scenario: Any,
    hang: Callable[[Any, Any], list[Any]] = lambda plant, instrument: [],
    hold: Callable[[Any, Any], dict[str, Any]] = lambda plant, scene_graph: {},
) -> Bedside:
    """Adds arm, instrument and abdomen to a diagram.

    The plant starts at rest, the shaft through the true fulcrum and unloaded.

    Args:
        builder: The diagram's builder.
        scenario: Has `robot`, `arm`, `instrument`, `abdomen`, `wall_motion` and
            `duration`, and may have `tip_push`.
        hang: Adds what else hangs on the instrument to the plant that is not yet
            finalized, and returns its model instances.
        hold: Likewise adds the tools that people hold, if the robot's can touch them.

    Raises:
        ValueError: If the start cannot be reached.
    """
    motion: WallMotionParams = scenario.wall_motion
    plant, scene_graph = add_plant_and_scene(builder)
    arm = add_arm(plant, params=scenario.arm)
    hung = scenario.instrument
    add, bore = (add_tube, 0.0062) if isinstance(hung, TubeParams) else THIN
    instrument = add(plant, plant.GetFrameByName("flange", arm), hung)
    abdomen = add_abdomen(
        plant,
        instrument.shaft.body_frame(),
        scenario.robot.p_WG,
        scenario.abdomen,
        bore=bore,
    )
    below = [instrument.instance, abdomen.sleeve_instance, *hang(plant, instrument)]
    add_scenery(plant, BASE_POSITION, not getattr(scenario, "organs", []))
    held = hold(plant, scene_graph)
    plant.Finalize()
    connect_poses(builder, plant, scene_graph, touches=bool(held))
    moved = motion.displacement(0.0)
    p_WG = np.add(scenario.robot.p_WG, moved)
    known = plant
    # Couplers would be constraints to the solver as well, and a bend a freedom.
    if plant.num_constraints() or hung.bending_stiffness:
        known = make_controller_plant(instrument=scenario.instrument)
    posture = home_posture(
        known,
        known.GetJointByName("joint1").model_instance(),
        known.GetFrameByName(INSTRUMENT_TIP),
        p_WG.tolist(),
        scenario.robot.p_WP,
    )
    plant.SetDefaultPositions(arm, posture)
    plant.SetDefaultPositions(abdomen.wall_instance, moved)
    context = plant.CreateDefaultContext()
    seat_sleeve(plant, context, abdomen)
    plant.SetDefaultPositions(plant.GetPositions(context))
    hold_still(builder, plant, abdomen.sleeve_instance)
    add_wall_motion(builder, plant, abdomen, motion, scenario.duration)
    pushed = getattr(scenario, "tip_push", TipPushParams())
    push = add_tip_push(builder, plant, instrument, pushed)
    systems = {
        "plant": plant,
        "scene_graph": scene_graph,
        "wall_force": add_wall_force(builder, plant, abdomen, motion.stiffness_factor),
    }
    if hung.bending_stiffness:
        systems["tool_shaft"] = add_tool_shaft(builder, plant, instrument)
    if push:
        systems["tip_push"] = push
    return Bedside(systems, posture, instrument, abdomen, below, held)


def stiffen(case: Any, station: Any, context: Any) -> None:
    """Sets the trocar's stiffness for the present time: insufflation stretches it.

    The spring's constants are parameters of the plant, which no block may change, so
    this is done between two advances. Grain and memory of its tissue stay as they are.

    Args:
        case: Its scenario has `abdomen` and `wall_motion`.
        station: The study's diagram.
        context: The root diagram's context.
    """
    motion = case.scenario.wall_motion
    if motion.stiffening == 0.0:
        return
    plant = station.GetSubsystemByName("plant")
    for index in range(plant.num_force_elements()):
        element = plant.get_force_element(ForceElementIndex(index))
        spring = isinstance(element, LinearBushingRollPitchYaw)
        if spring and element.frameA().name() == "fulcrum":
            stiffness = case.scenario.abdomen.stiffness * motion.stiffness_factor(
                context.get_time()
            )
            element.SetForceStiffnessConstants(
                plant.GetMyMutableContextFromRoot(context), [stiffness] * 3
            )
