"""The operating theatre: one continuous plant, and the bodies that people hold."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.abdomen.abdomen import add_abdomen, seat_sleeve
from plants.abdomen.scenery import add_scenery
from plants.abdomen.wall_force import add_wall_force
from plants.arm.arm import add_arm
from plants.arm.parameters import BASE_POSITION
from plants.arm.posture import home_posture
from plants.common.actuation import hold_still
from plants.common.scene import add_plant_and_scene, connect_poses
from plants.instruments.clearance import add_clearance
from plants.instruments.instrument import add_instrument
from plants.instruments.posed_tools import PosedToolsParams, add_posed_tools


@dataclass
class Theatre:
    """What `add_theatre` added.

    Attributes:
        systems: By the names that wires use.
        posture: Joint positions at the start (7) [rad].
    """

    systems: dict[str, Any]
    posture: np.ndarray


def add_theatre(builder: Any, scenario: Any) -> Theatre:
    """Adds arm, instrument, abdomen and the surgeon's tools to a diagram.

    The plant starts at rest, the shaft through the fulcrum and unloaded.

    Args:
        builder: The diagram's builder.
        scenario: A gauze scenario.

    Raises:
        ValueError: If the start cannot be reached.
    """
    plant, scene_graph = add_plant_and_scene(builder)
    arm = add_arm(plant, params=scenario.arm)
    instrument = add_instrument(
        plant, plant.GetFrameByName("flange", arm), scenario.instrument
    )
    abdomen = add_abdomen(
        plant, instrument.body.body_frame(), scenario.robot.p_WG, scenario.abdomen
    )
    add_scenery(plant, BASE_POSITION)
    plant.Finalize()
    connect_poses(builder, plant, scene_graph)
    posture = home_posture(
        plant, arm, instrument.tip, scenario.robot.p_WG, scenario.robot.p_WP
    )
    plant.SetDefaultPositions(arm, posture)
    context = plant.CreateDefaultContext()
    seat_sleeve(plant, context, abdomen)
    plant.SetDefaultPositions(plant.GetPositions(context))
    for instance in (abdomen.wall_instance, abdomen.sleeve_instance):
        hold_still(builder, plant, instance)
    looks = PosedToolsParams(
        view_half_angle=scenario.camera.half_angle,
        fulcrums=[
            scenario.target.p_WG,
            scenario.obstacle.p_WG,
            scenario.camera.p_WG,
        ],
    )
    tools = add_posed_tools(builder, scene_graph, plant, looks)
    systems = {
        "plant": plant,
        "scene_graph": scene_graph,
        "posed_tools": tools,
        "clearance": add_clearance(
            builder, scene_graph, instrument.shaft_geometry, tools.shafts
        ),
        "wall_force": add_wall_force(builder, plant, abdomen),
    }
    return Theatre(systems, posture)
