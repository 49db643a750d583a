"""The wrist's sensor against the plant's own reaction forces, without couplers."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from diagrams.bedside.bedside import add_bedside
from diagrams.common.run import start
from diagrams.common.study import cenic
from diagrams.studies import load_scenario
from plants.arm.arm import SetPoint
from plants.instruments.wrist_sensor import Felt, add_wrist_sensor
from systems.common.signal import view

PERIOD = 1.0 / 120.0


TISSUE = [
    *("abdomen.tissue.grain_stiffness=300", "abdomen.tissue.grain_direction=0.5"),
    *("abdomen.tissue.slow_stiffness=400", "abdomen.tissue.slow_time=0.5"),
]


def rows(load: float, more: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Reactions (n, 6) as the plant and as the sensor have them: the arm swings."""
    sets = ["wall_motion.rate=0.3", "compare=[]", *more]
    scenario = load_scenario("pwe_breathing", sets, duration=3.0)
    builder = DiagramBuilder()
    bedside = add_bedside(builder, scenario)
    plant = bedside.systems["plant"]
    sensor = add_wrist_sensor(
        builder,
        plant,
        bedside.instrument.body,
        bedside.abdomen,
        bedside.below,
        PERIOD,
    )
    push = ExternallyAppliedSpatialForce()
    push.body_index = bedside.instrument.body.index()
    push.p_BoBq_B = [0.0, 0.0, 0.3]
    push.F_Bq_W = SpatialForce([0.01, 0.0, 0.0], [load, -0.5 * load, 0.2 * load])
    source = builder.AddNamedSystem("push", ConstantValueSource(Value([push])))
    goal = SetPoint()(bedside.posture + 0.02, np.zeros(7))  # a jerk at the start
    held = builder.AddNamedSystem("held", ConstantVectorSource(goal))
    for block in (plant, sensor):
        builder.Connect(
            source.get_output_port(), block.GetInputPort("applied_spatial_force")
        )
    builder.Connect(held.get_output_port(), plant.GetInputPort("pa10_desired_state"))
    diagram = builder.Build()
    simulator = start(diagram, cenic())
    context = simulator.get_mutable_context()
    own, sensing = (block.GetMyContextFromRoot(context) for block in (plant, sensor))
    true, felt = [], []
    for step in range(240):
        simulator.AdvanceTo(step * PERIOD)
        reaction = plant.get_reaction_forces_output_port().Eval(own)
        F = reaction[int(bedside.instrument.sensor.index())]
        true.append([*F.translational(), *F.rotational()])
        seen = view(Felt, sensor.GetOutputPort("felt").Eval(sensing))
        felt.append([*seen.f, *seen.m])
    return np.array(true), np.array(felt)


def test_it_reads_what_the_weld_transmits():
    for load, more in ((0.0, []), (2.0, []), (0.0, TISSUE)):
        true, felt = rows(load, more)
        late = slice(60, None)  # the start's jerk has died away
        error = felt[late] - true[late]
        assert np.sqrt((error[:, :3] ** 2).mean()) < 0.02  # half a period of its rate
        assert np.sqrt((error[:, 3:] ** 2).mean()) < 0.005
        assert np.abs(error).max() < 0.1  # where the seal's friction turns round
        assert np.ptp(true[late], axis=0).max() > 0.1  # the wall breathes


def test_a_load_at_the_shaft_is_felt():
    change = rows(2.0, [])[1][100:] - rows(0.0, [])[1][100:]
    assert np.linalg.norm(change[:, :3], axis=1).mean() > 0.5
