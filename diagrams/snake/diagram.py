"""The diagram of a moving snake: from a tool pose to wires, and back to a pose."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import RandomSource

from diagrams.common.wiring import add_blocks, finish
from diagrams.snake.scenario import ELASTIC_STEP, SnakeScenario
from plants.snake.core import SnakeCoreParams
from plants.snake.elastic_wires import ElasticWires
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.looks import draw_channel
from plants.snake.parameters import SnakeParams
from plants.snake.signals import Drums
from plants.snake.snake import add_snake, set_default_posture
from systems.common.outside import Outside
from systems.common.signal import size
from systems.resection.wires.ball_location import BallLocation
from systems.resection.wires.base_sensor import BaseSensor, SensorNoise
from systems.resection.wires.contact_watch import ContactWatch
from systems.resection.wires.hysteresis_compensation import HysteresisCompensation
from systems.resection.wires.pretension_control import (
    CellNoise,
    PretensionControl,
)
from systems.resection.wires.resection_ik import ResectionIk
from systems.resection.wires.snake_location import SnakeLocation
from systems.resection.wires.tension_estimator import TensionEstimator
from systems.resection.wires.tip_reference import TipReference, reference
from systems.resection.wires.tool_load import ToolLoad
from systems.resection.wires.tool_tracker import PoseNoise, ToolTracker
from systems.resection.wires.wire_drums import WireDrums
from systems.resection.wires.wire_forward_actuation import WireForwardActuation
from systems.resection.wires.wire_inverse_actuation import (
    PAPERS,
    WireInverseActuation,
    wound_lengths,
)
from systems.resection.wires.wire_statics import WireStatics
from systems.resection.wires.wire_tension import WireTension
from systems.resection.wires.wire_watch import WireWatch

WIRES = (
    # What is asked for becomes a posture, and the posture lengths of wires.
    ("tip_reference.target", "resection_ik.target"),
    ("resection_ik.posture", "wire_inverse_actuation.posture"),
    ("wire_inverse_actuation.drums", "wire_drums.command"),
    # Where the snake is, and whether a wire is slack.
    ("plant.snake_state", "snake_location.state"),
    ("wire_watch.stop", "wire_drums.stop"),
)
"""Signals of all wire models."""

DRUM_WIRES = (
    # The lengths impose a posture.
    ("wire_drums.rates", "wire_forward_actuation.rates"),
    ("wire_drums.lengths", "wire_forward_actuation.lengths"),
    ("wire_forward_actuation.desired_state", "plant.snake_desired_state"),
    ("plant.snake_state", "wire_tension.state"),
    ("plant.snake_net_actuation", "wire_tension.net_actuation"),
    ("wire_tension.tension", "wire_watch.tension"),
)

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

STATICS_WIRES = (
    ("wire_drums.lengths", "wire_statics.lengths"),
    ("wire_drums.rates", "wire_statics.rates"),
    ("snake_location.tool", "tool_load.tool"),
    ("tool_load.force", "wire_statics.force"),
    ("wire_statics.desired_state", "plant.snake_desired_state"),
    ("wire_statics.tension", "wire_watch.tension"),
    ("wire_statics.stability", "wire_watch.stability"),
)

PRETENSION_WIRES = (
    ("wire_inverse_actuation.drums", "pretension_control.command"),
    ("wire_statics.tension", "pretension_control.tension"),
    ("cell_noise.output", "pretension_control.noise"),
    ("pretension_control.drums", "wire_drums.command"),
)

CONTACT_WIRES = (
    ("plant.snake_state", "base_sensor.state"),
    ("tool_load.force", "base_sensor.force"),
    ("base_noise.output", "base_sensor.noise"),
    ("base_sensor.wrench", "contact_watch.wrench"),
    ("resection_ik.posture", "contact_watch.posture"),
)

ESTIMATOR_WIRES = (
    ("wire_statics.tension", "tension_estimator.tension"),
    ("resection_ik.posture", "tension_estimator.posture"),
)

TRACKER_WIRES = (
    ("snake_location.tool", "tool_tracker.tool"),
    ("tracker_noise.output", "tool_tracker.noise"),
    ("tool_tracker.measured", "wire_inverse_actuation.measured"),
)

WIRES_OF = {
    "drums": DRUM_WIRES,
    "elastic": ELASTIC_WIRES,
    "statics": STATICS_WIRES,
}

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
    "drums": {**_PAPERS, "wires.tension": "wire_tension.tension"},
    "elastic": {**_PAPERS, "wires.tension": "elastic_wires.tension"},
    "statics": {
        "snake.balls": "snake_location.balls",
        "snake.gaps": "snake_location.gaps",
        "wires.tension": "wire_statics.tension",
        "wires.stability": "wire_statics.stability",
        "tool.force": "tool_load.force",
    },
}

ESTIMATOR_EXPORTS = {
    "wires.tip_tension": "wire_statics.tip_tension",
    "wires.interval": "tension_estimator.interval",
}

OPTIONS: dict[str, tuple[Any, dict[str, str]]] = {
    "estimate": (ESTIMATOR_WIRES, ESTIMATOR_EXPORTS),
    "control_pretension": (PRETENSION_WIRES, {"cells.code": "pretension_control.cell"}),
    "feel": (CONTACT_WIRES, {"base.contact": "contact_watch.contact"}),
}
"""Keys that add blocks to a snake of free balls: their wires and exports."""

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
    core = s.core if s.wires == "statics" else PAPERS
    wound = s.inverse_actuation
    if s.wires != "drums":
        wound = replace(wound, stiffness=s.drive.wire_stiffness)
    lengths = wound_lengths(start_posture(s), wound, s.snake, s.drive, core)
    return np.ravel(lengths).tolist()


def wire_chain(
    robot: Any,
    snake: SnakeParams,
    posture: list[float],
    core: SnakeCoreParams = PAPERS,
    **winding: Any,
) -> dict[str, Any]:
    """The blocks from a tool's pose to the drums, whatever the wires are.

    Args:
        robot: Has the parameters of each, `drive` and `period`.
        snake: The robot's geometry.
        posture: Where it starts, (7,).
        core: What stands between the balls.
        **winding: Parameters of the winding that are not the robot's.
    """
    wound = replace(robot.inverse_actuation, period=robot.period, **winding)
    lengths = wound_lengths(posture, wound, snake, robot.drive, core)
    return {
        "resection_ik": ResectionIk(
            replace(robot.resection_ik, period=robot.period), snake, posture
        ),
        "wire_inverse_actuation": WireInverseActuation(
            wound, snake, robot.drive, posture, core
        ),
        "wire_drums": WireDrums(
            replace(robot.drums, period=robot.period), snake, lengths
        ),
        "snake_location": SnakeLocation(snake),
        "wire_watch": WireWatch(replace(robot.watch, period=robot.period)),
    }


def drum_chain(
    robot: Any, snake: SnakeParams, posture: list[float], **winding: Any
) -> dict[str, Any]:
    """As `wire_chain`, and what stiff wires impose: the blocks of `DRUM_WIRES`."""
    return {
        **wire_chain(robot, snake, posture, **winding),
        "wire_forward_actuation": WireForwardActuation(
            snake, robot.drive, robot.period, posture
        ),
        "wire_tension": WireTension(robot.tension, snake),
    }


def make_blocks(scenario: SnakeScenario) -> dict[str, Any]:
    """The blocks of the diagram, by the names that the wires use."""
    s, posture = scenario, start_posture(scenario)
    blocks: dict[str, Any] = {
        # What is between winding and drums costs a period.
        "tip_reference": TipReference(
            replace(s.tip, lead=s.period * (2 if s.control_pretension else 1)), s.snake
        )
    }
    if s.wires == "drums":
        return blocks | drum_chain(s, s.snake, posture)
    stiffness = s.drive.wire_stiffness
    if s.wires == "elastic":
        return {
            **blocks,
            **wire_chain(s, s.snake, posture, stiffness=stiffness),
            "wire_forward_actuation": WireForwardActuation(
                s.snake, s.drive, s.period, posture
            ),
            "elastic_wires": ElasticWires(s.elastic, s.snake, s.drive),
        }
    # A controller of its own stands in the ideal one's place.
    slack = replace(s.drive, pretension=0.0) if s.control_pretension else s.drive
    blocks |= {
        **wire_chain(s, s.snake, posture, s.core, stiffness=stiffness),
        "snake_location": BallLocation(s.snake),
        "tool_load": ToolLoad(replace(s.load, period=s.period)),
        "wire_statics": WireStatics(
            s.snake, slack, s.core, s.period, posture, s.friction
        ),
    }
    if s.control_pretension:
        *lengths, travel = start_lengths(s)
        control = replace(s.pretension, period=s.period)
        wound = Drums(tuple(lengths), travel)
        blocks["pretension_control"] = PretensionControl(control, s.drive, wound)
        blocks["cell_noise"] = RandomSource(
            RandomDistribution.kGaussian, size(CellNoise), s.period
        )
    if s.feel:
        blocks["base_sensor"] = BaseSensor(s.base, s.snake, s.drive)
        blocks["base_noise"] = RandomSource(
            RandomDistribution.kGaussian, size(SensorNoise), s.period
        )
        blocks["contact_watch"] = ContactWatch(
            replace(s.contact, period=s.period), s.snake, s.drive
        )
    if s.estimate:
        blocks["tension_estimator"] = TensionEstimator(
            replace(s.estimator, period=s.period), s.snake
        )
    if s.compensation != "none":
        # In place of the paper's map from a posture to drums.
        blocks["wire_inverse_actuation"] = HysteresisCompensation(
            replace(s.hysteresis, period=s.period),
            s.inverse_actuation,
            s.snake,
            s.drive,
            s.core,
            posture,
        )
    if s.compensation == "tracked":
        blocks["tool_tracker"] = ToolTracker(s.tracker)
        blocks["tracker_noise"] = RandomSource(
            RandomDistribution.kGaussian, size(PoseNoise), s.tracker.period
        )
    return blocks


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
        "spherical" if scenario.wires == "statics" else "coupled",
    )
    channel = scenario.snake.body_radius + CHANNEL_CLEARANCE
    draw_channel(plant, plant.world_body(), channel)
    plant.Finalize()
    set_default_posture(plant, snake, start_posture(scenario))
    made, wires = make_blocks(scenario), WIRES + WIRES_OF[scenario.wires]
    if scenario.compensation == "tracked":
        wires += TRACKER_WIRES
    exports = EXPORTS | EXPORTS_OF[scenario.wires]
    for key, (added, told) in OPTIONS.items():
        if getattr(scenario, key):
            sinks = {sink for _, sink in added}
            wires = (*(wire for wire in wires if wire[1] not in sinks), *added)
            exports = exports | told
    if scenario.guided is not None:
        *lengths, s = start_lengths(scenario)
        rest = Drums(tuple(lengths), s)
        tape, period = scenario.guided, scenario.period
        made["wires_outside"] = Outside(Drums, rest, tape, period)
        wires = (*(wire for wire in wires if wire[1] != HAND[1]), HAND)
    blocks = add_blocks(builder, made, swaps)
    systems = blocks | {"plant": plant, "scene_graph": scene_graph}
    return finish(builder, "snake", systems, wires, exports, scenario.faults)
