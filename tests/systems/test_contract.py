"""One contract for every block there is."""

from functools import cache
import importlib
import inspect
import pkgutil

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem, PortDataType
import pytest

from diagrams.studies import STUDIES, build, load_scenario
import plants
from plants.crowd.guided_disc import GuidedDisc
from plants.surgeon.guided_tool import GuidedTool
from plants.surgeon.led_tool import LedTool
from plants.surgeon.tracked_tool import TrackedTool
import systems
from systems.common.block import Block
from systems.common.step_block import StepBlock
from systems.switching.navigation_planner import NavigationPlanner

BASES = (Block, StepBlock, NavigationPlanner, LedTool)


def all_blocks(package) -> list[type]:
    """Every concrete LeafSystem defined in a package."""
    found = []
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(info.name)
        for _, kind in inspect.getmembers(module, inspect.isclass):
            own = kind.__module__ == info.name
            if own and issubclass(kind, LeafSystem) and kind not in BASES:
                found.append(kind)
    return sorted(found, key=lambda kind: kind.__name__)


ALONE = [GuidedDisc, GuidedTool, TrackedTool]
"""Of the plants' floor, but needing none; in a diagram while somebody guides them."""
BLOCKS = [*all_blocks(systems), *ALONE]
DIAGRAMS: dict[str, list[str]] = {
    "gauze_static": [],
    "gauze_hunted": [],
    "gauze_dynamic_real": [],
    "gauze_press": [],
    "gauze_touched": [],
    "pwe_arc": ["faults=[{kind: force_stuck}]"],
    "nav_one_static": [],
    "nav_crowd": [],
    "nav_lidar_crowd": [],
    "snake_wire_break": [],
    "snake_unstable": [],
    "resect_paper": ["spacing=0.001", "reach_effort=0.05"],
    "keyhole_circle": [],
}
"""Scenarios with overrides: every kind of diagram, and every observer in one."""
# What observes a plant has no ports' values without it: tested in its diagram.
OBSERVERS = [kind for kind in all_blocks(plants) if kind not in ALONE]


def assert_documented(dut: LeafSystem) -> None:
    """Every port has a name that stands in the class's docstring."""
    text = inspect.getdoc(type(dut))
    ports = [dut.get_input_port(i) for i in range(dut.num_input_ports())]
    ports += [dut.get_output_port(i) for i in range(dut.num_output_ports())]
    assert ports
    for port in ports:
        assert f"``{port.get_name()}``" in text


def fixed_context(dut: LeafSystem):
    """A context with every input port at its example."""
    context = dut.CreateDefaultContext()
    dut.SetRandomContext(context, RandomGenerator(3))
    for index in range(dut.num_input_ports()):
        port = dut.get_input_port(index)
        if port.get_data_type() == PortDataType.kVectorValued:
            port.FixValue(context, dut.AllocateInputVector(port).value())
        else:
            port.FixValue(context, dut.AllocateInputAbstract(port))
    return context


def outputs(dut: LeafSystem, context) -> list[np.ndarray]:
    """All vector outputs."""
    values = []
    for index in range(dut.num_output_ports()):
        port = dut.get_output_port(index)
        if port.get_data_type() == PortDataType.kVectorValued:
            values.append(np.array(port.Eval(context)))
    return values


def trajectory(dut: LeafSystem) -> np.ndarray:
    """All outputs of a block alone, at its example inputs, over 0.1 s."""
    context = fixed_context(dut)
    simulator = Simulator(dut, context)
    simulator.Initialize()
    rows = []
    for time in (0.0, 0.03, 0.1):
        simulator.AdvanceTo(time)
        rows.append(np.concatenate([np.zeros(0), *outputs(dut, context)]))
    return np.array(rows)


def test_there_are_blocks():
    assert len(BLOCKS) >= 10


@pytest.mark.parametrize("kind", BLOCKS, ids=lambda kind: kind.__name__)
def test_ports_are_named_and_documented(kind):
    assert_documented(kind())


@cache
def diagram_of(name: str):
    """A scenario's diagram, made once."""
    return build(load_scenario(name, DIAGRAMS[name]))


def test_every_kind_of_diagram_is_there():
    assert {load_scenario(name).system for name in DIAGRAMS} == set(STUDIES)


@pytest.mark.parametrize("name", DIAGRAMS)
def test_observers_in_their_diagram(name):
    diagram = diagram_of(name)
    context = diagram.CreateDefaultContext()
    for system in diagram.GetSystems():
        if type(system) in OBSERVERS:
            assert_documented(system)
            values = outputs(system, system.GetMyContextFromRoot(context))
            assert all(np.isfinite(value).all() for value in values)


def test_every_observer_is_in_a_diagram():
    seen = set()
    for name in DIAGRAMS:
        seen |= {type(system) for system in diagram_of(name).GetSystems()}
    assert set(OBSERVERS) <= seen


@pytest.mark.parametrize("kind", BLOCKS, ids=lambda kind: kind.__name__)
def test_outputs_are_finite_and_repeatable(kind):
    first, second = trajectory(kind()), trajectory(kind())
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("kind", BLOCKS, ids=lambda kind: kind.__name__)
def test_no_state_hides_outside_the_context(kind):
    dut = kind()
    fresh = trajectory(dut)
    again = trajectory(dut)  # a second life of the same object, a new context
    np.testing.assert_array_equal(fresh, again)
    context = fixed_context(dut)
    before = context.Clone()
    for one, two in zip(outputs(dut, context), outputs(dut, context), strict=True):
        np.testing.assert_array_equal(one, two)
    for group in range(context.num_discrete_state_groups()):
        np.testing.assert_array_equal(
            context.get_discrete_state(group).value(),
            before.get_discrete_state(group).value(),
        )


@pytest.mark.parametrize("kind", BLOCKS, ids=lambda kind: kind.__name__)
def test_inputs_are_left_alone(kind):
    dut = kind()
    context = fixed_context(dut)
    ports = [dut.get_input_port(i) for i in range(dut.num_input_ports())]
    vectors = [p for p in ports if p.get_data_type() == PortDataType.kVectorValued]
    before = [np.array(port.Eval(context)) for port in vectors]
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.03)
    outputs(dut, context)
    for port, value in zip(vectors, before, strict=True):
        np.testing.assert_array_equal(port.Eval(context), value)


ALL, NONE = slice(None), slice(0)
RATE, HELD, TOOL = (ALL, NONE), (NONE, ALL), (slice(6, 12), slice(0, 6))
COMMANDS = {
    "ArcNavigation": {"tool": TOOL},
    "BackwardMovement": {"v3": RATE},
    "ClassicalPlanner": {"v_R": RATE},
    "ClearanceConstraint": {"v_safe": RATE},
    "CameraPlanner": {"shaft": HELD, "view_cone": HELD},
    "Endoscope": {"shaft": HELD, "view_cone": HELD},
    "FuzzyArbiter": {"v_R": RATE},
    "GoToTarget": {"v1": RATE},
    "GuidedTool": {"tip_velocity": RATE},
    "HandNavigation": {"tool": TOOL},
    "HysteresisCompensation": {"drums": HELD},
    "JointCommands": {"posture": HELD, "set_point": HELD},
    "OnlinePlayer": {"target": HELD},
    "OrcaPlanner": {"v_R": RATE},
    "PassiveWristEmulation": {"tool": TOOL},
    "PretensionControl": {"drums": HELD},
    "ResectionIk": {"posture": HELD},
    "SnakeTask": {"target": HELD},
    "StatechartPlanner": {"v_R": RATE},
    "StraightTool": {"tool": TOOL},
    "SwitchingPlanner": {"v_R": RATE},
    "TissuePress": {"v_R": RATE},
    "ToolBypass": {"v1": RATE},
    "ToolNavigation": {"tool": TOOL},
    "TouchYield": {"v_R": RATE},
    "TrackedTool": {"tip_velocity": RATE},
    "TubeTask": {"tool": TOOL},
    "UnicycleControl": {"command": RATE},
    "VelocityCorrections": {"v2": RATE},
    "WireDrums": {"rates": RATE, "lengths": HELD},
    "WireForwardActuation": {"desired_state": (slice(7, 14), slice(0, 7))},
    "WireInverseActuation": {"drums": HELD},
    "WireStatics": {"desired_state": (slice(19, 38), slice(0, 19))},
}
"""Outputs that command a motion, by block: which of their elements are rates, that must
come to zero, and which are poses or set-points, that must come to a halt."""
OBSERVE = {
    *("FulcrumEstimator", "OperationPhases", "OpticalTracker", "OrganEstimator"),
    *("GridMapping", "Perception", "RobotLocation", "SnakeLoad", "SnakeLocation"),
    *("StationTarget", "Tracking"),
    *("ToolWrench", "TrajectoryEstimator", "TubeLocation", "WireTension", "WireWatch"),
    *("BallLocation", "Registration", "TipLoad", "ToolLoad", "WrenchWatch"),
    *("NavigationMonitor", "TissueForce", "WallWrench"),
    *("GuidedDisc", "SensorZeroing", "TensionEstimator", "ToolTracker"),
    *("BaseSensor", "ContactWatch", "ProcedureChooser"),
    *("ShaftBend", "TouchWatch"),
}
"""Blocks that command nothing."""
LEAD = {"Outside", "ProcedurePlayer", "TipReference"}
"""Blocks that command without an input."""
BROKEN = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}
GO_ON = {
    *("ClearanceConstraint.guide", "ClearanceConstraint.robot_tool"),
    *("ClearanceConstraint.obstacles", "ClearanceConstraint.target"),
    *("ClearanceConstraint.camera", "ClearanceConstraint.view_cone"),
    *("ClearanceConstraint.permission", "ToolBypass.camera"),
}
"""Inputs without which a block goes on, no faster than before: the constraint lets pass
what it cannot judge, and a camera out of sight is no obstacle."""
CASES = [
    (kind, port.get_name())
    for kind in BLOCKS
    if kind.__name__ in COMMANDS
    for port in map(kind().get_input_port, range(kind().num_input_ports()))
]


def test_it_is_known_what_every_block_commands():
    assert {kind.__name__ for kind in BLOCKS} == {*COMMANDS, *OBSERVE, *LEAD}


def commands(dut: LeafSystem, context) -> dict[str, np.ndarray]:
    """A block's outputs that command a motion."""
    names = COMMANDS[type(dut).__name__]
    return {name: np.array(dut.GetOutputPort(name).Eval(context)) for name in names}


@pytest.mark.parametrize("value", BROKEN)
@pytest.mark.parametrize(
    ("kind", "name"), CASES, ids=[f"{kind.__name__}.{name}" for kind, name in CASES]
)
def test_a_broken_input_ends_in_rest(kind, name, value):
    case = f"{kind.__name__}.{name}"
    dut = kind()
    context = fixed_context(dut)
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.3)
    port = dut.GetInputPort(name)
    port.FixValue(context, np.full(port.size(), BROKEN[value]))
    first = last = commands(dut, context)
    for time in np.arange(0.4, 3.0, 0.1):
        simulator.AdvanceTo(time)
        before, last = last, commands(dut, context)
        assert all(np.isfinite(value).all() for value in last.values())
    for output, (rates, places) in COMMANDS[kind.__name__].items():
        limit = np.abs(first[output][rates]) if case in GO_ON else 1e-6
        assert (np.abs(last[output][rates]) <= limit).all()
        np.testing.assert_allclose(
            last[output][places], before[output][places], atol=1e-7
        )
