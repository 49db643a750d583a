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
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource
import pytest
from scipy.interpolate import CubicSpline

from plants.abdomen.abdomen import Abdomen, AbdomenParams, add_abdomen, seat_sleeve
from plants.abdomen.scenery import add_scenery
from plants.abdomen.wall_force import WallForce, add_wall_force
from plants.arm.arm import SetPoint, add_arm
from plants.arm.controller_plant import make_controller_plant
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

    def signed_distances(self) -> list[float]:
        """Of the robot to obstacle, target and camera, as SceneGraph has them."""
        graph = self.simulator.get_system().GetSubsystemByName("scene_graph")
        context = graph.GetMyContextFromRoot(self.simulator.get_context())
        query = graph.get_query_output_port().Eval(context)
        return [
            query.ComputeSignedDistancePairClosestPoints(
                self.instrument.shaft_geometry, self.tools.shafts[name]
            ).distance
            for name in ("obstacle", "target", "camera")
        ]

    def reaction(self) -> Any:
        """What the wrist sensor feels, in the mount frame."""
        port = self.plant.get_reaction_forces_output_port()
        return port.Eval(self.context)[int(self.instrument.sensor.index())]


class Follower(LeafSystem):
    """Sends a joint trajectory's set-points, each held for a period."""

    def __init__(self, servo: SetPoint, path: CubicSpline, period: float) -> None:
        super().__init__()
        self._servo, self._path, self._rate = servo, path, path.derivative()
        self._tool = InstrumentParams()
        state = self.DeclareDiscreteState(14)
        self.DeclareStateOutputPort("desired_state", state)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Any, state: Any) -> None:
        time = context.get_time()
        q = self._path(time)
        state.set_value(self._servo(q, self._rate(time), carrying(self._tool, q)))


def joint_path(
    scene_plant: Any, arm: Any, tip: Any, p_WP: Callable, duration: float
) -> CubicSpline:
    """Joint angles that carry the tip along p_WP(t) through the origin."""
    times = np.linspace(0.0, duration, int(50 * duration) + 1)
    postures = [home_posture(scene_plant, arm, tip, (0, 0, 0), p_WP(t)) for t in times]
    return CubicSpline(times, postures)


def carrying(instrument: InstrumentParams, q: Any) -> np.ndarray:
    """Joint torques in Nm (7) that carry the instrument's weight."""
    plant = make_controller_plant(instrument=instrument)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.array(q))
    return -plant.CalcGravityGeneralizedForces(context)


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    """Makes a scene; the shaft may start beside the fulcrum."""

    def make(
        p_WP: Any = (0.0, 0.0, -0.12),
        aim: Any = (0.0, 0.0, 0.0),
        abdomen_params: AbdomenParams | None = None,
        instrument_params: InstrumentParams | None = None,
        tool_shafts: dict[str, list[float]] | None = None,
        p_WP_of_time: Callable[[float], Any] | None = None,
        duration: float = 1.0,
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
        sources = {}
        for name, fulcrum in zip(tools.shafts, tools.params.fulcrums, strict=True):
            shaft = (tool_shafts or {}).get(
                name, [fulcrum[0], fulcrum[1], -0.05, *DOWN]
            )
            source = builder.AddNamedSystem(f"tool_{name}", ConstantVectorSource(shaft))
            builder.Connect(source.get_output_port(), tools.GetInputPort(name))
            sources[name] = source
        clearance = add_clearance(
            builder, plant, scene_graph, instrument.shaft_geometry, tools
        )
        for name, source in sources.items():
            builder.Connect(source.get_output_port(), clearance.GetInputPort(name))
        wall_force = add_wall_force(builder, plant, abdomen)
        servo = SetPoint(period=period)
        controller: Any
        if p_WP_of_time:
            path = joint_path(plant, arm, instrument.tip, p_WP_of_time, duration)
            q0 = path(0.0)
            controller = Follower(servo, path, period)
        else:
            q0 = home_posture(plant, arm, instrument.tip, aim, p_WP)
            weight = carrying(instrument.params, q0)
            controller = ConstantVectorSource(servo(q0, np.zeros(7), weight))
        source = builder.AddNamedSystem("controller", controller)
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
