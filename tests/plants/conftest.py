"""A whole scene to test plants in: arm, instrument, abdomen, posed tools."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
import pytest

from plants.abdomen.abdomen import Abdomen, AbdomenParams, add_abdomen, seat_sleeve
from plants.abdomen.scenery import add_scenery
from plants.abdomen.wall_force import WallForce, add_wall_force
from plants.arm.arm import SetPoint, add_arm
from plants.arm.kinematics import payload_torque
from plants.arm.parameters import BASE_POSITION
from plants.arm.posture import home_posture
from plants.common.actuation import hold_still
from plants.instruments.clearance import Clearance, add_clearance
from plants.instruments.instrument import Instrument, InstrumentParams, add_instrument
from plants.instruments.posed_tools import PosedTools, add_posed_tools

DOWN = [0.0, 0.0, -1.0]


@dataclass
class Scene:
    """A running scene.

    Attributes:
        servo: Builds the arm's desired state.
        q0: The starting posture.
    """

    plant: Any
    arm: Any
    instrument: Instrument
    abdomen: Abdomen
    tools: PosedTools
    clearance: Clearance
    wall_force: WallForce
    servo: SetPoint
    q0: np.ndarray
    simulator: Simulator
    context: Any

    def output(self, system: Any, port: str) -> np.ndarray:
        """A vector output of a system, now."""
        context = system.GetMyContextFromRoot(self.simulator.get_context())
        return system.GetOutputPort(port).Eval(context)

    def reaction(self) -> Any:
        """What the wrist sensor feels, in the mount frame."""
        port = self.plant.get_reaction_forces_output_port()
        return port.Eval(self.context)[int(self.instrument.sensor.index())]


def carrying(instrument: InstrumentParams, q: np.ndarray) -> list[float]:
    """Torques that carry the instrument."""
    return payload_torque(q.tolist(), instrument.mass, instrument.centre)


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    """Makes a scene; the shaft may start beside the fulcrum."""

    def make(
        p_WP: Any = (0.0, 0.0, -0.12),
        aim: Any = (0.0, 0.0, 0.0),
        abdomen_params: AbdomenParams | None = None,
        instrument_params: InstrumentParams | None = None,
        tool_shafts: dict[str, list[float]] | None = None,
        controller: Callable[[SetPoint, np.ndarray], Any] | None = None,
        accuracy: float = 1e-3,
        period: float = 1.0 / 120.0,
    ) -> Scene:
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        arm = add_arm(plant)
        flange = plant.GetFrameByName("flange", arm)
        instrument = add_instrument(plant, flange, instrument_params)
        abdomen = add_abdomen(
            plant, instrument.body.body_frame(), params=abdomen_params
        )
        add_scenery(plant, BASE_POSITION)
        plant.Finalize()
        for instance in (abdomen.wall_instance, abdomen.sleeve_instance):
            hold_still(builder, plant, instance)
        tools = add_posed_tools(builder, scene_graph, plant)
        for name, fulcrum in zip("SOC", tools.params.fulcrums, strict=True):
            shaft = (tool_shafts or {}).get(
                name, [fulcrum[0], fulcrum[1], -0.05, *DOWN]
            )
            source = builder.AddNamedSystem(f"tool_{name}", ConstantVectorSource(shaft))
            builder.Connect(source.get_output_port(), tools.GetInputPort(name))
        clearance = add_clearance(
            builder, scene_graph, instrument.shaft_geometry, tools.shafts
        )
        wall_force = add_wall_force(builder, plant, abdomen)
        q0 = home_posture(plant, arm, instrument.tip, aim, p_WP)
        servo = SetPoint(period=period)
        source = builder.AddNamedSystem(
            "controller",
            controller(servo, q0)
            if controller
            else ConstantVectorSource(
                servo(q0, np.zeros(7), carrying(instrument.params, q0))
            ),
        )
        builder.Connect(
            source.get_output_port(), plant.get_desired_state_input_port(arm)
        )
        simulator = Simulator(builder.Build())
        ApplySimulatorConfig(
            SimulatorConfig(
                integration_scheme="cenic", accuracy=accuracy, max_step_size=0.01
            ),
            simulator,
        )
        context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(context, arm, q0)
        seat_sleeve(plant, context, abdomen)
        return Scene(
            plant,
            arm,
            instrument,
            abdomen,
            tools,
            clearance,
            wall_force,
            servo,
            q0,
            simulator,
            context,
        )

    return make
