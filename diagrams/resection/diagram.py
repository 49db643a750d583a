"""The diagram of a resection: plan, tool poses, wires, snake, and tissue that goes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from diagrams.common.wiring import add_blocks, finish
from diagrams.resection.operation import Operation
from diagrams.snake.robot import (
    is_free,
    joints,
    snake_chain,
    snake_exports,
    snake_wires,
)
from plants.snake.balls import ball_posture
from plants.snake.looks import draw_channel
from plants.snake.snake import add_snake, set_default_posture
from plants.tissue.tissue_carver import Carving, TissueCarver
from systems.resection.wires.online_player import OnlinePlayer
from systems.resection.wires.procedure_chooser import ProcedureChooser
from systems.resection.wires.procedure_player import ProcedurePlayer

RESECTION_WIRES = (
    ("procedure_player.target", "resection_ik.target"),
    # What the tool's true path removes.
    ("snake_location.posture", "tissue_carver.posture"),
    ("procedure_player.entry", "tissue_carver.entry"),
    ("procedure_player.tool", "tissue_carver.tool"),
)

ONLINE_WIRES = (
    ("procedure_chooser.accepted", "procedure_player.accepted"),
    ("procedure_player.taken", "procedure_chooser.taken"),
    ("procedure_player.waiting", "procedure_chooser.waiting"),
)
"""Besides, where procedures are chosen while the robot works."""

ONLINE_EXPORTS = {
    "plan.taken": "procedure_player.taken",
    "plan.waiting": "procedure_player.waiting",
}

EXPORTS = {
    "tip.reference": "procedure_player.reference",
    "plan.progress": "procedure_player.progress",
    "snake.tool": "snake_location.tool",
    "snake.posture": "snake_location.bends",
    "ik.status": "resection_ik.status",
    "drums.limited": "wire_drums.limited",
    "tissue.index": "tissue_carver.index",
    "tissue.removed": "tissue_carver.removed",
    "tissue.touched": "tissue_carver.touched",
    "tissue.way": "tissue_carver.way",
    "watch.alarm": "wire_watch.alarm",
    "scene_graph.query": "scene_graph.query",
}


def make_blocks(case: Operation) -> dict[str, Any]:
    """The blocks of the diagram, by the names that the wires use."""
    s, postures, done = case.scenario, case.session.postures, case.done
    start = postures[done.posture].tolist()
    player = replace(s.player, lead=s.period)
    plays: dict[str, Any]
    if case.choosing is not None:
        book = case.choosing.book
        plays = {
            "procedure_player": OnlinePlayer(player, s.snake, book.pages, done.posture),
            "procedure_chooser": ProcedureChooser(book, s.period),
        }
    else:
        told = case.waits, case.session.entries, case.session.tool_radii
        plays = {
            "procedure_player": ProcedurePlayer(
                player, s.snake, postures, done.posture, *told
            )
        }
    return {
        **snake_chain(s, s.snake, start),
        **plays,
        "tissue_carver": TissueCarver(
            replace(s.carver, period=s.period),
            s.snake,
            Carving(case.session.volume, s.snake, done),
            ball_posture(start).tolist() if is_free(s) else start,
        ),
    }


def make_resection_diagram(
    case: Operation, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram that carries a plan out.

    Args:
        case: The parameters and the plan.
        swaps: Systems that replace blocks of the same name and ports.

    Returns:
        The diagram, its signals exported as `model.signal`.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    scenario, session = case.scenario, case.session
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    snake = add_snake(
        plant,
        plant.world_frame(),
        scenario.snake,
        scenario.drive,
        joints=joints(scenario),
    )
    draw_channel(plant, plant.world_body(), session.volume.channel)
    plant.Finalize()
    set_default_posture(plant, snake, session.postures[case.done.posture])
    blocks = add_blocks(builder, make_blocks(case), swaps)
    systems = blocks | {"plant": plant, "scene_graph": scene_graph}
    wires, exports = snake_wires(scenario), snake_exports(scenario)
    if case.choosing is not None:
        wires, exports = wires + ONLINE_WIRES, exports | ONLINE_EXPORTS
    return finish(
        builder,
        "resection",
        systems,
        RESECTION_WIRES + wires,
        EXPORTS | exports,
        scenario.faults,
    )
