"""The posed tools: poses, looks out of contact, true distances."""

import math

import numpy as np
from pydrake.geometry import Role, SceneGraph
from pydrake.systems.framework import DiagramBuilder
import pytest

from plants.instruments.posed_tools import TOOLS, PosedTools, PosedToolsParams


def posed(shafts, params=None, tools=TOOLS):
    """The tools' poses in W, by frame name."""
    builder = DiagramBuilder()
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    dut = PosedTools(scene_graph, params, tools)
    context = dut.CreateDefaultContext()
    for name, shaft in shafts.items():
        dut.GetInputPort(name).FixValue(context, shaft)
    poses = dut.GetOutputPort("poses").Eval(context)
    inspector = scene_graph.model_inspector()
    return dut, {
        inspector.GetName(frame): poses.value(frame)
        for frame in inspector.FramesForSource(dut.source_id)
    }


def test_frames_stand_at_the_tips_along_the_shafts():
    slanted = np.array([0.6, 0.0, -0.8])
    shafts = {
        "target": [0.01, 0.02, -0.10, *slanted],
        "obstacle": [0.05, 0.00, -0.05, 0.0, 0.0, -1.0],
        "camera": [0.00, 0.05, -0.03, 0.0, -0.6, -0.8],
    }
    _, poses = posed(shafts)
    for name, shaft in shafts.items():
        X_WT = poses[f"tool_{name}"]
        np.testing.assert_allclose(X_WT.translation(), shaft[:3])
        np.testing.assert_allclose(X_WT.rotation().col(2), shaft[3:], atol=1e-12)


def test_trocars_ride_on_the_shafts_at_the_fulcrums():
    dut, _ = posed({name: [0, 0, 0, 0, 0, -1] for name, _ in TOOLS})
    for fulcrum in (np.array(p) for p in dut.params.fulcrums):
        u = np.array([0.36, 0.48, -0.8])
        shaft = [*(fulcrum + 0.1 * u), *u]
        _, poses = posed({name: shaft for name, _ in TOOLS})
        near = [poses[f"trocar_{n}"].translation() for n, _ in TOOLS]
        distances = np.linalg.norm(np.array(near) - fulcrum, axis=1)
        assert distances.min() == pytest.approx(0.0, abs=1e-9)


def test_any_number_of_tools_is_posed():
    tools = (("near", "obstacle"), ("far", "obstacle"), ("S", "target"))
    shafts = {name: [0.01 * i, 0, -0.1, 0, 0, -1] for i, (name, _) in enumerate(tools)}
    dut, poses = posed(shafts, PosedToolsParams(), tools)
    assert list(dut.shafts) == ["near", "far", "S"]
    for name, shaft in shafts.items():
        np.testing.assert_allclose(poses[f"tool_{name}"].translation(), shaft[:3])


def test_poses_depend_on_nothing_but_the_shafts():
    dut, _ = posed({name: [0, 0, 0, 0, 0, -1] for name, _ in TOOLS})
    assert dut.num_continuous_states() == 0
    assert dut.GetOutputPort("poses").get_index() == 0
    for port, _ in TOOLS:
        assert f"``{port}``" in PosedTools.__doc__


def test_overlap_with_the_robots_shaft_is_not_a_contact_and_is_measured(make_scene):
    # O's tip stands in the middle of the robot's shaft.
    scene = make_scene(
        p_WP=(0.0, 0.0, -0.12),
        tool_shafts={"obstacle": [0.0, 0.0, -0.06, -0.6, 0.0, -0.8]},
    )
    scene.simulator.AdvanceTo(0.2)  # CENIC would end the process here
    results = scene.plant.get_contact_results_output_port().Eval(scene.context)
    assert results.num_point_pair_contacts() == 0
    distance = scene.output(scene.clearance, "clearance")[0]
    # The ball at the end of O has its middle 1.5 mm off the shaft's axis.
    assert distance == pytest.approx(-0.0035, abs=1e-4)


def test_only_shafts_have_proximity_geometry(make_scene):
    scene = make_scene()
    query = scene.plant.get_geometry_query_input_port().Eval(scene.context)
    inspector = query.inspector()
    names = [
        inspector.GetName(g).split("::")[-1]
        for g in inspector.GetAllGeometryIds(Role.kProximity)
    ]
    assert sorted(names) == ["shaft", "shaft_camera", "shaft_obstacle", "shaft_target"]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (PosedToolsParams(tool_length=2.0), "posed_tools.tool_length=2.0 m: .*<= 0.6"),
        (PosedToolsParams(view_half_angle=math.nan), "view_half_angle=nan"),
        (
            PosedToolsParams(fulcrums=[[0.0, 0.0, 0.0]]),
            "fulcrums=.*one .*of target, obstacle",
        ),
        (
            PosedToolsParams(fulcrums=[[0.0, 0.0, math.inf]] * 3),
            "posed_tools.fulcrums=.* x 3 numbers",
        ),
    ],
)
def test_impossible_parameters_are_refused(params, message):
    with pytest.raises(ValueError, match=message):
        PosedTools(SceneGraph(), params)
