"""One contract for every block there is."""

import importlib
import inspect
import pkgutil

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem, PortDataType
import pytest

from diagrams.studies import build, load_scenario
import plants
import systems
from systems.common.block import Block
from systems.common.step_block import StepBlock
from systems.switching.navigation_planner import NavigationPlanner

BASES = (Block, StepBlock, NavigationPlanner)


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


BLOCKS = all_blocks(systems)
DIAGRAMS = ["gauze_static", "pwe_arc", "nav_one_static"]
"""One scenario of every kind of diagram."""
# What observes a plant has no ports' values without it: tested in its diagram.
OBSERVERS = all_blocks(plants)


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


@pytest.mark.parametrize("name", DIAGRAMS)
def test_observers_in_their_diagram(name):
    scenario = load_scenario(name)
    diagram = build(scenario)
    context = diagram.CreateDefaultContext()
    for system in diagram.GetSystems():
        if type(system) in OBSERVERS:
            assert_documented(system)
            values = outputs(system, system.GetMyContextFromRoot(context))
            assert all(np.isfinite(value).all() for value in values)


def test_every_observer_is_in_a_diagram():
    seen = set()
    for name in DIAGRAMS:
        scenario = load_scenario(name)
        diagram = build(scenario)
        seen |= {type(system) for system in diagram.GetSystems()}
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
