"""The diagram of a moving snake: from a tool pose to wires, and back to a pose."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from diagrams.common.wiring import add_blocks, finish
from diagrams.snake import sensing
from diagrams.snake.robot import (
    DRUM_EXPORTS,
    STATICS_EXPORTS,
    WIRES,
    is_free,
    joints,
    snake_chain,
    snake_wires,
    wire_chain,
)
from diagrams.snake.scenario import ELASTIC_STEP, SnakeScenario
from diagrams.snake.sensing import chosen, sensing_blocks, sensing_wires
from plants.snake.elastic_wires import ElasticWires
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.looks import draw_channel
from plants.snake.signals import Drums
from plants.snake.snake import add_snake, set_default_posture
from systems.common.outside import Outside
from systems.resection.wires.tip_reference import TipReference, reference
from systems.resection.wires.wire_forward_actuation import WireForwardActuation
from systems.resection.wires.wire_inverse_actuation import PAPERS, wound_lengths

TARGET = ("tip_reference.target", "resection_ik.target")

ELASTIC_WIRES = (
    ("wire_drums.rates", "wire_forward_actuation.rates"),
    ("elastic_wires.measured", "wire_forward_actuation.lengths"),
    ("elastic_wires.travel", "plant.snake_desired_state"),
    ("plant.snake_state", "elastic_wires.state"),
    ("wire_drums.lengths", "elastic_wires.lengths"),
    ("wire_drums.rates", "elastic_wires.rates"),
    ("elastic_wires.generalized_force", "plant.applied_generalized_force"),
    ("elastic_wires.tension", "wire_watch.tension"),
)

EXPORTS = {
    "tip.reference": "tip_reference.reference",
    "snake.tool": "snake_location.tool",
    "snake.posture": "snake_location.bends",
    "ik.status": "resection_ik.status",
    "drums.lengths": "wire_drums.lengths",
    "drums.limited": "wire_drums.limited",
    "watch.alarm": "wire_watch.alarm",
    "scene_graph.query": "scene_graph.query",
}

_PAPERS = {
    "snake.coupler_error": "snake_location.coupler_error",
    "wires.residual": "wire_forward_actuation.residual",
}
EXPORTS_OF = {
    "drums": {**_PAPERS, **DRUM_EXPORTS},
    "elastic": {**_PAPERS, "wires.tension": "elastic_wires.tension"},
    "statics": STATICS_EXPORTS,
}

HAND = ("wires_outside.told", "wire_drums.command")
"""The wire of a hand that winds the drums in the inverse actuation's place."""

CHANNEL_CLEARANCE = 1.0e-3
"""Between the snake's body and the access channel, in m; drawn only."""


def start_posture(scenario: SnakeScenario) -> list[float]:
    """The posture (7) that the tip's reference begins with."""
    target = reference(scenario.tip, 0.0, scenario.snake)
    return tool_postures(*target, scenario.snake).x.tolist()


def start_lengths(scenario: SnakeScenario) -> list[float]:
    """What is wound out at the start: nine wires, and the translation [m] (10)."""
    s = scenario
    core = s.core if is_free(s) else PAPERS
    wound = s.inverse_actuation
    if s.wires != "drums":
        wound = replace(wound, stiffness=s.drive.wire_stiffness)
    lengths = wound_lengths(start_posture(s), wound, s.snake, s.drive, core)
    return np.ravel(lengths).tolist()


def make_blocks(scenario: SnakeScenario) -> dict[str, Any]:
    """The blocks of the diagram, by the names that the wires use."""
    s, posture = scenario, start_posture(scenario)
    blocks: dict[str, Any] = {
        # What is between winding and drums costs a period.
        "tip_reference": TipReference(
            replace(s.tip, lead=s.period * (2 if s.control_pretension else 1)), s.snake
        )
    }
    if s.wires != "elastic":
        blocks |= snake_chain(s, s.snake, posture)
        return blocks | sensing_blocks(s, posture, start_lengths(s))
    stiffness = s.drive.wire_stiffness
    return {
        **blocks,
        **wire_chain(s, s.snake, posture, stiffness=stiffness),
        "wire_forward_actuation": WireForwardActuation(
            s.snake, s.drive, s.period, posture
        ),
        "elastic_wires": ElasticWires(s.elastic, s.snake, s.drive),
    }


def make_snake_diagram(
    scenario: SnakeScenario, swaps: Mapping[str, Any] | None = None
) -> Any:
    """Makes the diagram of a moving snake.

    Args:
        scenario: The parameters.
        swaps: Systems that replace blocks of the same name and ports.

    Returns:
        The diagram, its signals exported as `model.signal`.

    Raises:
        ValueError: If a parameter makes no sense, or a swap has no place.
    """
    elastic = scenario.wires == "elastic"
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(
        builder, time_step=ELASTIC_STEP if elastic else 0.0
    )
    snake = add_snake(
        plant,
        plant.world_frame(),
        scenario.snake,
        scenario.drive,
        elastic,
        joints(scenario),
    )
    channel = scenario.snake.body_radius + CHANNEL_CLEARANCE
    draw_channel(plant, plant.world_body(), channel)
    plant.Finalize()
    set_default_posture(plant, snake, start_posture(scenario))
    made = make_blocks(scenario)
    robot = WIRES + ELASTIC_WIRES if elastic else snake_wires(scenario)
    wires = sensing_wires(scenario, (TARGET, *robot))
    exports = EXPORTS | EXPORTS_OF[scenario.wires]
    for key in chosen(scenario):
        exports = exports | sensing.EXPORTS_OF[key]
    if scenario.guided is not None:
        *lengths, s = start_lengths(scenario)
        rest = Drums(tuple(lengths), s)
        tape, period = scenario.guided, scenario.period
        made["wires_outside"] = Outside(Drums, rest, tape, period)
        wires = (*(wire for wire in wires if wire[1] != HAND[1]), HAND)
    blocks = add_blocks(builder, made, swaps)
    systems = blocks | {"plant": plant, "scene_graph": scene_graph}
    return finish(builder, "snake", systems, wires, exports, scenario.faults)
