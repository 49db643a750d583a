"""Tests of tools that are held: kinematics, the hand's lead, the force of contact."""

from functools import cache

import numpy as np
from pydrake.geometry import Capsule
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder
import pytest

from plants.common.scene import add_plant_and_scene, connect_poses
from plants.surgeon.held_tools import (
    HandForce,
    HeldTools,
    HeldToolsParams,
    add_held_tools,
    in_hand,
    joints_of,
    shaft_of,
)
from plants.surgeon.surgeon_tool import SurgeonTool, SurgeonToolParams
from systems.common.signal import reader, view
from systems.common.signals import Shaft

P_WG = (0.0, 0.1, 0.0)
MOTION = SurgeonToolParams(
    p_WG=list(P_WG),
    times=[0.2, 1.2],
    points=[[-0.02, 0.05, -0.12], [0.04, 0.05, -0.12]],
)
BAR = [0.02, 0.05, -0.08]
"""A bar along y that stands in the tool's way [m]."""


def test_joints_and_shaft_are_each_others_inverse():
    rng = np.random.default_rng(1)
    for q in rng.uniform(-0.5, 0.5, (20, 5)) * (0.04, 0.04, 1.0, 1.0, 0.1):
        q[4] += 0.1
        shaft = shaft_of(P_WG, q)
        assert np.linalg.norm(shaft.u) == pytest.approx(1.0)
        np.testing.assert_allclose(joints_of(P_WG, shaft), q, atol=1e-12)


def test_the_hand_has_a_side_force_by_the_lever_and_all_of_one_along():
    p, down = (0.0, 0.1, -0.1), (0.0, 0.0, -1.0)
    assert in_hand(P_WG, 0.25, (2.0, 0.0, 0.0), p, down) == pytest.approx(0.8)
    assert in_hand(P_WG, 0.25, (0.0, 0.0, 3.0), p, down) == pytest.approx(3.0)


@cache
def pushed(bar: bool):
    """Tip errors [m], the last hand force, joints, wish, and the params, of a push."""
    params, builder = HeldToolsParams(active=True), DiagramBuilder()
    plant, scene = add_plant_and_scene(builder)
    held = add_held_tools(plant, scene, {"obstacle": list(P_WG)}, params)
    if bar:
        across = RotationMatrix.MakeXRotation(np.pi / 2.0)
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform(across, BAR),
            Capsule(0.0025, 0.3),
            "bar",
            CoulombFriction(0.1, 0.1),
        )
    plant.Finalize()
    connect_poses(builder, plant, scene, touches=True)
    hand = builder.AddNamedSystem("hand", SurgeonTool(MOTION))
    at = hand.GetOutputPort("shaft").Eval(hand.CreateDefaultContext())
    start = joints_of(P_WG, reader(Shaft)(at))
    tool = held["obstacle"].instance
    plant.SetDefaultPositions(tool, start)
    dut = builder.AddNamedSystem("dut", HeldTools(held, {"obstacle": start}, params))
    for output, name in (
        (hand.GetOutputPort("shaft"), "obstacle"),
        (plant.get_state_output_port(tool), "obstacle_state"),
        (plant.get_contact_results_output_port(), "contact_results"),
    ):
        builder.Connect(output, dut.GetInputPort(name))
    desired = dut.GetOutputPort("obstacle_desired")
    builder.Connect(desired, plant.get_desired_state_input_port(tool))
    simulator = Simulator(builder.Build())
    config = SimulatorConfig(integration_scheme="cenic", accuracy=1e-3)
    ApplySimulatorConfig(config, simulator)
    context, errors = simulator.get_mutable_context(), []
    mine = dut.GetMyContextFromRoot(context)
    for k in range(1, 25):
        simulator.AdvanceTo(k / 15.0)
        is_at = dut.GetOutputPort("obstacle_shaft").Eval(mine)[:3]
        wished = dut.GetInputPort("obstacle").Eval(mine)[:3]
        errors.append(float(np.linalg.norm(is_at - wished)))
    told = dut.GetOutputPort("hand_force").Eval(mine).reshape(1, -1)
    q = plant.GetPositions(plant.GetMyContextFromRoot(context), tool)
    return errors, told[0], q, desired.Eval(mine)[:5], params


def test_where_nothing_is_the_tool_goes_with_the_hand():
    errors, told, *_ = pushed(bar=False)
    assert max(errors) < 2e-4
    assert not view(HandForce, told).f.any()


def test_the_force_told_is_the_one_that_bends_the_hands_springs():
    errors, told, q, wish, params = pushed(bar=True)
    force = view(HandForce, told)
    stiffness, _ = params.gains()
    spring = stiffness * (wish - q)
    assert errors[-1] > 0.005
    assert spring[0] > 1.0
    assert -force.f[0] == pytest.approx(spring[0], rel=0.01)
    assert -force.f[1] == pytest.approx(spring[1], abs=0.02)
    assert force.peak >= np.linalg.norm(force.f) > 0.0
    # The bar's surface is where they touch.
    assert abs(force.p[0] - BAR[0]) < 0.004 and abs(force.p[2] - BAR[2]) < 0.004


def test_capsules_so_soft_that_they_pass_each_other_are_refused():
    with pytest.raises(ValueError, match="contact_stiffness"):
        HeldTools({}, {}, HeldToolsParams(contact_stiffness=5e3))
