"""Grain and memory of a trocar's tissue, against Drake and the solid's formula."""

from math import cos, exp, sin

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, WeldJoint
from pydrake.systems.framework import DiagramBuilder
import pytest

from diagrams.common.run import start
from diagrams.common.study import cenic
from plants.abdomen.abdomen import AbdomenParams, add_abdomen, seat_sleeve
from plants.abdomen.tissue import TissueParams
from plants.abdomen.wall_force import add_wall_force
from plants.common.actuation import hold_still

K, OFFSET = 500.0, 0.003


def held(tissue, turn, times, spin=0.0):
    """A shaft welded `OFFSET` aside: true force, and what its weld feels, at times."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    ball = SpatialInertia.SolidSphereWithMass(0.1, 0.01)
    shaft = plant.AddRigidBody("shaft", ball)
    down = RotationMatrix.MakeXRotation(np.pi) @ RotationMatrix.MakeZRotation(spin)
    aside = [OFFSET * cos(turn), OFFSET * sin(turn), 0.2]
    X_WS = RigidTransform(down, aside)
    weld = WeldJoint("held", plant.world_frame(), shaft.body_frame(), X_WS)
    plant.AddJoint(weld)
    params = AbdomenParams(stiffness=K, tissue=tissue)
    abdomen = add_abdomen(plant, shaft.body_frame(), params=params)
    plant.Finalize()
    for instance in (abdomen.wall_instance, abdomen.sleeve_instance):
        hold_still(builder, plant, instance)
    truth = add_wall_force(builder, plant, abdomen)
    simulator = start(builder.Build(), cenic())
    own = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    seat_sleeve(plant, own, abdomen)
    seen = truth.GetMyContextFromRoot(simulator.get_context())
    rows = []
    for time in times:
        simulator.AdvanceTo(time)
        force = truth.GetOutputPort("force").Eval(seen).copy()
        reaction = (
            plant.get_reaction_forces_output_port()
            .Eval(own)[int(weld.index())]
            .translational()
        )
        felt = -(down @ reaction) + [0.0, 0.0, 0.1 * 9.81]
        rows.append([force[:2], felt[:2]])
    return np.array(rows)


def test_what_is_held_aside_relaxes_as_the_solid_does():
    times, tau, slow = [0.02, 0.3, 1.2], 0.3, 400.0
    tissue = TissueParams(slow_stiffness=slow, slow_time=tau)
    rows = held(tissue, 0.0, times)
    told = [-(K + slow * exp(-t / tau)) * OFFSET for t in times]
    np.testing.assert_allclose(rows[:, 0, 0], told, rtol=0.02)
    np.testing.assert_allclose(rows[:, 0, 1], 0.0, atol=1e-3)


@pytest.mark.parametrize("spin", [0.0, 1.0])
def test_the_grain_has_its_direction_however_the_tool_spins(spin):
    tissue = TissueParams(grain_stiffness=300.0, grain_direction=0.6)
    for turn, stiffness in ((0.6, 800.0), (0.6 + np.pi / 2, 500.0)):
        force, felt = held(tissue, turn, [0.5], spin)[0]
        told = -stiffness * OFFSET * np.array([cos(turn), sin(turn)])
        np.testing.assert_allclose(force, told, atol=0.01)
        np.testing.assert_allclose(felt, force, atol=0.005)  # the weld is Drake's
