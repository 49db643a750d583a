"""A continuous plant and its SceneGraph, set up for bodies that blocks pose."""

from typing import Any

from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant


def add_plant_and_scene(builder: Any) -> tuple[Any, Any]:
    """Adds a continuous MultibodyPlant and a SceneGraph, without contact between them.

    CENIC asks for contact geometry several times a step. The project's plants have
    springs where they touch, so the plant asks a second, empty SceneGraph: bodies
    that Python blocks pose in the first one are then evaluated only when somebody
    measures or looks. (It also ends no process: CENIC in Drake 1.58 does, on contact
    with geometry that the plant does not own.) Call `connect_poses` once the plant is
    finalized.

    Returns:
        The plant, named "plant", and the SceneGraph, named "scene_graph".
    """
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def connect_poses(builder: Any, plant: Any, scene_graph: Any) -> None:
    """Lets the SceneGraph follow the finalized plant, and the plant see no contact."""
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    empty = builder.AddNamedSystem("no_contacts", SceneGraph())
    builder.Connect(
        empty.get_query_output_port(), plant.get_geometry_query_input_port()
    )
