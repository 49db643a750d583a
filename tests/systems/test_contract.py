"""One contract for every block there is."""

import importlib
import inspect
import pkgutil

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem, PortDataType
import pytest

import plants
import systems
from systems.common.block import Block


def all_blocks() -> list[type]:
    """Every concrete LeafSystem defined in `systems` and `plants`."""
    found = []
    for package in (systems, plants):
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(info.name)
            for _, kind in inspect.getmembers(module, inspect.isclass):
                own = kind.__module__ == info.name
                if own and issubclass(kind, LeafSystem) and kind is not Block:
                    found.append(kind)
    return sorted(found, key=lambda kind: kind.__name__)


BLOCKS = all_blocks()
# A block that reads a SceneGraph has no outputs without one: its diagram's tests
# cover it.
ALONE = [kind for kind in BLOCKS if not kind().HasInputPort("query_object")]


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
    dut = kind()
    text = inspect.getdoc(kind)
    ports = [dut.get_input_port(i) for i in range(dut.num_input_ports())]
    ports += [dut.get_output_port(i) for i in range(dut.num_output_ports())]
    assert ports
    for port in ports:
        assert f"``{port.get_name()}``" in text


@pytest.mark.parametrize("kind", ALONE, ids=lambda kind: kind.__name__)
def test_outputs_are_finite_and_repeatable(kind):
    first, second = trajectory(kind()), trajectory(kind())
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("kind", ALONE, ids=lambda kind: kind.__name__)
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
