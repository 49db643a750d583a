"""Organs in a gauze delivery: their systems, wires, signals and figures."""

from dataclasses import replace
from typing import Any

import numpy as np

from plants.instruments.clearance import capsule_of
from plants.organs.organ_touch import OrganGap, OrganTouch, Touch
from plants.organs.organs import OrganSet, add_organ_motions, organ_set
from plants.organs.posed_organs import PosedOrgans
from systems.common.signal import Many
from systems.common.signals import MovingPoint
from systems.motion.tissue_press import Phase, Press, TissuePress
from systems.sensing.tissue_force import TissueForce, TissueTouch, WallWrench

AMONG = (
    *("organ_touch", "posed_organs", "go_to_target", "clearance_constraint"),
    *("tissue_force", "tissue_press", "endoscope"),
)
"""Blocks that take how organs move, where they have a port for it."""
WIRES = [
    *(("organs.y0", f"{block}.organs") for block in AMONG),
    ("organ_touch.applied", "plant.applied_spatial_force"),
]
"""The last of them only where tissue pushes back."""
EXPORTS = {
    "organs.touch": "organ_touch.touch",
    "organs.gaps": "organ_touch.gaps",
    "organs.moved": "organs.y0",
}


def known_organs(scenario: Any) -> OrganSet | None:
    """What blocks get of the organs; None without any."""
    return organ_set(scenario.organs) if scenario.organs else None


def pushes_back(scenario: Any) -> bool:
    """Whether tissue does; where nothing keeps the robot clear of it, it has to."""
    return scenario.organ_touch.acts or not scenario.clearance_constraint.active


def add_organs(
    builder: Any, scenario: Any, theatre: Any, organs: OrganSet
) -> dict[str, Any]:
    """Adds what moves, shows and yields; returns the systems by name."""
    plant, scene_graph = theatre.systems["plant"], theatre.systems["scene_graph"]
    shaft = theatre.instrument.shaft_geometry
    body = int(theatre.instrument.shaft.index())
    robot = capsule_of(scene_graph.model_inspector(), shaft, body)
    how = replace(scenario.organ_touch, acts=pushes_back(scenario))
    touch = OrganTouch(organs, scenario.organs, robot, how)
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


PRESS_WIRES = [
    ("wrench_watch.believed", "tissue_force.wrench"),
    ("tool_wrench.shaft", "tissue_force.shaft"),
    ("passive_wrist.pivot", "tissue_force.pivot"),
    ("wrench_watch.believed", "wall_wrench.wrench"),
    ("tool_wrench.shaft", "wall_wrench.shaft"),
    ("tissue_force.touch", "wall_wrench.touch"),
    ("wall_wrench.wall", "fulcrum_estimator.wrench"),
    ("wall_wrench.wall", "passive_wrist.wrench"),
    ("wall_wrench.wall", "navigation_monitor.wrench"),
    ("clearance_constraint.v_safe", "tissue_press.v_safe"),
    ("clearance_constraint.status", "tissue_press.clearance"),
    ("go_to_target.guide", "tissue_press.guide"),
    ("robot_location.robot_tool", "tissue_press.robot_tool"),
    ("target.estimate", "tissue_press.target"),
    ("tissue_force.touch", "tissue_press.touch"),
    ("passive_wrist.permission", "tissue_press.permission"),
    ("tissue_press.v_R", "tool_navigation.v_R"),
    ("organ_touch.applied", "wrist_sensor.applied_spatial_force"),
]
"""The tissue's force told from the wall's, and the loop that presses with it."""
PRESS_EXPORTS = {
    "press.status": "tissue_press.press",
    "press.touch": "tissue_force.touch",
}


def add_press(builder: Any, scenario: Any, organs: OrganSet) -> dict[str, Any]:
    """Adds the blocks of pressing; returns the systems by name."""
    systems = {
        "tissue_force": TissueForce(
            scenario.tissue_force, organs, scenario.instrument.length
        ),
        "wall_wrench": WallWrench(),
        "tissue_press": TissuePress(scenario.press, organs.names),
    }
    for name, system in systems.items():
        builder.AddNamedSystem(name, system)
    sensor = builder.GetSubsystemByName("wrist_sensor")
    return systems | {"wrist_sensor": sensor}


def wired(scenario: Any, wires: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """A diagram's wires with those of the organs, which take the place of some."""
    wires = wires + (WIRES if pushes_back(scenario) else WIRES[:-1])
    if scenario.press.active:
        taken = {sink for _, sink in PRESS_WIRES}
        wires = [wire for wire in wires if wire[1] not in taken] + PRESS_WIRES
    return wires


def organ_signals(scenario: Any) -> dict[str, Any]:
    """What is logged of organs."""
    if not scenario.organs:
        return {}
    names = tuple(organ.name for organ in scenario.organs)
    found: dict[str, Any] = {"organs.touch": Touch}
    found["organs.gaps"] = Many(OrganGap, names)
    found["organs.moved"] = Many(MovingPoint, names)
    if scenario.press.active:
        found |= {"press.status": Press, "press.touch": TissueTouch}
    return found


def press_figures(run: Any, force: np.ndarray) -> dict[str, Any]:
    """The true force while the block holds it; None if it never does."""
    phase, wanted = run.press.status.phase, run.scenario.press.force
    held = force[np.round(phase) == Phase.HOLDING]
    if not len(held):
        return {"press_force_mean": None, "press_force_worst": None}
    worst = held[np.abs(held - wanted).argmax()]
    return {
        "press_force_mean": float(held.mean()),
        "press_force_worst": float(worst),
    }


def organ_figures(run: Any) -> dict[str, Any]:
    """The figures of a run with organs."""
    if not run.scenario.organs:
        return {}
    force = np.linalg.norm(run.organs.touch.f, axis=1)
    figures = press_figures(run, force) if run.scenario.press.active else {}
    return figures | {
        "min_organ_clearance": float(run.organs.gaps.distance.min()),
        "max_tissue_force": float(force.max()),
    }
