"""What every block owes to Drake."""

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Integrator

from systems.common.block import Block


def test_an_integrator_is_answered_by_every_block(monkeypatch):
    asked = []
    monkeypatch.setattr(
        Block, "DoCalcTimeDerivatives", lambda *given: asked.append(given[1:])
    )
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource([1.0]))
    moves = builder.AddSystem(Integrator(1))
    builder.Connect(source.get_output_port(), moves.get_input_port())
    builder.AddSystem(Block())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.1)
    assert asked and asked[0][1].size() == 0  # it has no continuous state
