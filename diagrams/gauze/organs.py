"""Organs in a gauze delivery: their systems, wires, signals and figures."""

from typing import Any

import numpy as np

from plants.instruments.clearance import capsule_of
from plants.organs.organ_touch import OrganGap, OrganTouch, Touch
from plants.organs.organs import OrganSet, add_organ_motions, organ_set
from plants.organs.posed_organs import PosedOrgans
from systems.common.signal import Many

AMONG = ("organ_touch", "posed_organs", "go_to_target", "clearance_constraint")
"""Blocks that take how organs move, where they have a port for it."""
EXPORTS = {"organs.touch": "organ_touch.touch", "organs.gaps": "organ_touch.gaps"}


def known_organs(scenario: Any) -> OrganSet | None:
    """What blocks get of the organs; None without any."""
    return organ_set(scenario.organs) if scenario.organs else None


def add_organs(
    builder: Any, scenario: Any, theatre: Any, organs: OrganSet
) -> dict[str, Any]:
    """Adds what moves, shows and yields; returns the systems by name."""
    plant, scene_graph = theatre.systems["plant"], theatre.systems["scene_graph"]
    shaft = theatre.instrument.shaft_geometry
    body = int(theatre.instrument.body.index())
    robot = capsule_of(scene_graph.model_inspector(), shaft, body)
    touch = OrganTouch(organs, scenario.organs, robot, scenario.organ_touch)
    posed = PosedOrgans(scene_graph, scenario.organs)
    motions = add_organ_motions(
        builder, scenario.organs, scenario.wall_motion, scenario.duration
    )
    builder.AddNamedSystem("organ_touch", touch)
    builder.AddNamedSystem("posed_organs", posed)
    poses = scene_graph.get_source_pose_port(posed.source_id)
    builder.Connect(posed.GetOutputPort("poses"), poses)
    builder.Connect(plant.GetOutputPort("body_poses"), touch.GetInputPort("body_poses"))
    return {"organs": motions, "organ_touch": touch, "posed_organs": posed}


WIRES = [
    *(("organs.y0", f"{block}.organs") for block in AMONG),
    ("organ_touch.applied", "plant.applied_spatial_force"),
]


def organ_signals(scenario: Any) -> dict[str, Any]:
    """What is logged of organs."""
    if not scenario.organs:
        return {}
    names = tuple(organ.name for organ in scenario.organs)
    return {"organs.touch": Touch, "organs.gaps": Many(OrganGap, names)}


def organ_figures(run: Any) -> dict[str, Any]:
    """The figures of a run with organs."""
    if not run.scenario.organs:
        return {}
    force = np.linalg.norm(run.organs.touch.f, axis=1)
    return {
        "min_organ_clearance": float(run.organs.gaps.distance.min()),
        "max_tissue_force": float(force.max()),
    }
