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


def crossed(params, along_tool, along_bar, depth, turn=0.5 * np.pi):
    """Force on the bar [N] and the normal from tool to bar, where the two cross.

    Args:
        params: Of the tool, which hangs from the origin along -z.
        along_tool: From its tip [m], to where they cross.
        along_bar: From the bar's end [m].
        depth: How far they are into each other [m].
        turn: Between the two [rad].
    """
    builder = DiagramBuilder()
    plant, scene = add_plant_and_scene(builder)
    held = add_held_tools(plant, scene, {"obstacle": [0.0, 0.0, 0.0]}, params)
    # The bar's z goes from the crossing along x, turned towards the tool's.
    u = np.array([np.sin(turn), 0.0, np.cos(turn)])
    at = np.array([0.0, params.diameter - depth, along_tool - 0.1])
    middle = at + u * (along_bar - 0.15)
    plant.RegisterCollisionGeometry(
        plant.world_body(),
        RigidTransform(RotationMatrix.MakeYRotation(turn), middle),
        Capsule(0.5 * params.diameter, 0.3),
        "bar",
        CoulombFriction(0.1, 0.1),
    )
    plant.Finalize()
    connect_poses(builder, plant, scene, touches=True)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    context = plant.GetMyContextFromRoot(root)
    plant.SetPositions(context, held["obstacle"].instance, [0.0, 0.0, 0.0, 0.0, 0.1])
    results = plant.get_contact_results_output_port().Eval(context)
    bodies = {int(held["obstacle"].body.index())}
    force, normals = np.zeros(3), []
    for i in range(results.num_point_pair_contacts()):
        info = results.point_pair_contact_info(i)
        sign = 1.0 if int(info.bodyA_index()) in bodies else -1.0
        force += sign * info.contact_force()
        normals.append(-sign * info.point_pair().nhat_BA_W)
    return force, np.array(normals)


@pytest.mark.parametrize("depth", [2e-4, 5e-4, 1e-3])
def test_crossed_shafts_press_each_other_as_hertz_has_it(depth):
    params = HeldToolsParams(active=True)
    deepest = 5.0 / params.contact_stiffness  # at 5 N, by what the parameter says
    expected = 5.0 * (depth / deepest) ** 1.5
    for shift in (0.0, 5e-4, 1e-3):
        force, _ = crossed(params, 0.06 + shift, 0.1, depth)
        # Deep in, the outer ones push aslant.
        assert force[1] == pytest.approx(expected, rel=0.15)
        assert np.hypot(force[0], force[2]) < 0.1 * expected


@pytest.mark.parametrize("along_bar", [0.0, 0.005, 0.012])
@pytest.mark.parametrize("turn", [0.5, 1.0, 2.0])
def test_near_an_end_they_push_each_other_apart_and_not_along(along_bar, turn):
    params = HeldToolsParams(active=True)
    force, normals = crossed(params, 0.06, along_bar, 5e-4, turn)
    assert len(normals) and np.all(normals[:, 1] > 0.75)
    assert np.linalg.norm(force[[0, 2]]) < 0.2 * force[1]
