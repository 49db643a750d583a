"""A continuous plant and its SceneGraph, set up for bodies that blocks pose."""

from typing import Any

from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant


def add_plant_and_scene(builder: Any) -> tuple[Any, Any]:
    """Adds a continuous MultibodyPlant and a SceneGraph, without contact between them.

    CENIC asks for contact geometry several times a step. The plant asks a second
    SceneGraph, which is empty or has the plant's own geometry alone: bodies that Python
    blocks pose in the first one are then evaluated only when somebody measures or
    looks. (It also ends no process: CENIC in Drake 1.58 does, on contact with geometry
    that the plant does not own.) Call `connect_poses` once the plant is finalized.

    Returns:
        The plant, named "plant", and the SceneGraph, named "scene_graph".
    """
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def connect_poses(
    builder: Any, plant: Any, scene_graph: Any, touches: bool = False
) -> None:
    """Lets the SceneGraph follow the finalized plant.

    Args:
        builder: Of the diagram.
        plant: The plant.
        scene_graph: Its SceneGraph, with no geometry but the plant's as yet.
        touches: Whether the plant's bodies have contact with each other; none if not.
    """
    source, poses = plant.get_source_id(), plant.get_geometry_pose_output_port()
    builder.Connect(poses, scene_graph.get_source_pose_port(source))
    asked = builder.AddNamedSystem(
        "contacts" if touches else "no_contacts",
        scene_graph.Clone() if touches else SceneGraph(),
    )
    if touches:
        builder.Connect(poses, asked.get_source_pose_port(source))
    builder.Connect(
        asked.get_query_output_port(), plant.get_geometry_query_input_port()
    )
