"""Pretension control on a snake whose drums err, and on cells that fail."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import turns_of
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.statics import Statics
from systems.resection.wires.pretension_control import (
    Cell,
    PretensionControl,
    PretensionControlParams,
)

X = posture_of([0.0, 0.4, 0.2, -1.2, 0.2, 2.5, 0.2])
ASKED = np.append(wire_lengths(X, SnakeParams()) - 0.5 / 2e4, 0.0)


def tick(dut, context):
    new = dut.EvalUniquePeriodicDiscreteUpdate(context)
    for i in range(context.num_discrete_state_groups()):
        context.SetDiscreteState(i, np.array(new.get_vector(i).value()))


def controlled(seed, bias=0.0, steps=150):
    """Least and greatest tension with drums 0.1 mm off: by length, and controlled."""
    rng = np.random.default_rng(seed)
    off = 1e-4 * rng.choice([-1.0, 1.0], 9)
    biases = (bias * rng.choice([-1.0, 1.0], 9)).tolist()
    dut = PretensionControl(PretensionControlParams(bias=biases))
    context, snake = dut.CreateDefaultContext(), Statics()
    turns, drums, tensions = turns_of(X), ASKED, []
    dut.GetInputPort("command").FixValue(context, ASKED)
    for _ in range(steps):
        found = snake.equilibrium(turns, wound=drums[:9] + off)
        assert found.converged
        turns = found.turns
        tensions.append(found.T)
        dut.GetInputPort("tension").FixValue(context, found.T)
        dut.GetInputPort("noise").FixValue(context, rng.standard_normal(9))
        tick(dut, context)
        drums = dut.GetOutputPort("drums").Eval(context).copy()
    assert dut.GetOutputPort("cell").Eval(context)[0] == Cell.GOOD
    return tensions[0], np.array(tensions[-20:])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_slack_that_lengths_leave_is_taken_up(seed):
    alone, kept = controlled(seed)
    assert alone.min() < 0.05
    assert kept.min() > 0.3 - 0.1
    biased = controlled(seed, bias=0.1)[1]
    assert biased.min() > 0.3 - 0.1 - 0.1


def told(values):
    """Drums and code of a block that is told cells' tensions one after another."""
    dut = PretensionControl(PretensionControlParams(same=3))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("command").FixValue(context, ASKED)
    rng, found = np.random.default_rng(0), []
    for T in values:
        dut.GetInputPort("tension").FixValue(context, T)
        dut.GetInputPort("noise").FixValue(context, rng.standard_normal(9))
        tick(dut, context)
        drums = np.array(dut.GetOutputPort("drums").Eval(context))
        found.append((drums, *dut.GetOutputPort("cell").Eval(context)))
    return found


@pytest.mark.parametrize(
    ("broken", "code"), [(np.nan, Cell.NO_NUMBER), (90.0, Cell.OUT_OF_RANGE)]
)
def test_a_cell_that_fails_leaves_the_drums_for_good(broken, code):
    slack, bad = np.full(9, 0.1), np.full(9, 0.1)
    bad[4] = broken
    found = told([slack, slack, bad, slack, slack])
    assert found[1][1] == Cell.GOOD and found[1][0][0] < found[0][0][0]
    for drums, *why in found[2:]:
        assert why == [code, 4.0]
        np.testing.assert_array_equal(drums, found[1][0])


def test_a_stuck_cell_is_told_from_a_steady_one():
    dut = PretensionControl(PretensionControlParams(same=3))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("command").FixValue(context, ASKED)
    dut.GetInputPort("tension").FixValue(context, np.full(9, 2.0))
    noise, codes = np.ones(9), []
    for k in range(6):
        noise = np.arange(9.0) + k
        noise[7] = 0.0  # all others change
        dut.GetInputPort("noise").FixValue(context, noise)
        tick(dut, context)
        codes.append(dut.GetOutputPort("cell").Eval(context).tolist())
    assert codes[2] == [Cell.GOOD, -1.0]
    assert codes[-1] == [Cell.STUCK, 7.0]


def test_it_does_not_wind_up():
    """A cell that never sees more than nothing winds to the limit, and comes back."""
    slack, taut = np.zeros(9), np.full(9, 5.0)
    found = told([slack] * 2000 + [taut] * 60)
    assert ASKED[0] - found[1999][0][0] == pytest.approx(2e-3)
    assert found[-1][0][0] == pytest.approx(ASKED[0])
