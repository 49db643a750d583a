"""Tapes, and the block that plays them or takes what is said."""

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from systems.common.outside import PERIOD, Outside
from systems.common.signals import Point
from systems.common.tape import load_tape, save_tape

TIMES = [0.0, 1.0 / 30.0, 0.1]
ROWS = [[0.1, 0.2, -0.3], [1.0 / 3.0, 1e-17, 2.0], [0.0, 0.0, 0.5]]


@pytest.fixture
def tape(tmp_path):
    path = tmp_path / "tape.csv"
    save_tape(path, Point, TIMES, ROWS)
    return path


def test_a_tape_keeps_every_digit(tape):
    times, rows = load_tape(tape, Point)
    np.testing.assert_array_equal(times, TIMES)
    np.testing.assert_array_equal(rows, ROWS)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "line 1: expected 't,x,y,z'"),
        ("t,a,b,c\n", "line 1: expected 't,x,y,z'"),
        ("t,x,y,z\n", "nothing was said"),
        ("t,x,y,z\n0,1,2\n", "line 2: expected 4 finite numbers"),
        ("t,x,y,z\n0,1,2,nan\n", "line 2: expected 4 finite numbers"),
        ("t,x,y,z\n0,1,2,3\n0,1,2,3\n", "line 3: times must increase"),
        ("t,x,y,z\n0,1,2,password\n", "line 2: expected 4 finite numbers"),
        ("\0" * 9, "cannot be read as CSV|line 1: expected"),
    ],
)
def test_what_is_no_tape_is_refused(tmp_path, text, told):
    path = tmp_path / "tape.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=told) as caught:
        load_tape(path, Point)
    assert "password" not in str(caught.value)


def test_a_tape_that_is_not_there(tmp_path):
    with pytest.raises(ValueError, match="cannot be read: No such file"):
        Outside(Point, tape=tmp_path / "none.csv")


def run(block, said, count=10):
    """What is told at every instant, the block being told some of it."""
    simulator = Simulator(block)
    context = simulator.get_mutable_context()
    simulator.Initialize()
    rows, taken = [], []
    for k in range(count):
        if k in said:
            block.say(context, Point(tuple(said[k])))
            taken.append(context.get_time())
        simulator.AdvanceTo((k + 1) * PERIOD)
        rows.append(np.array(block.GetOutputPort("told").Eval(context)))
    return np.array(rows), taken


def test_what_was_said_plays_back_the_same(tmp_path):
    said = {0: ROWS[0], 3: ROWS[1], 7: ROWS[2]}
    live, times = run(Outside(Point), said)
    np.testing.assert_array_equal(live[[0, 2, 3, 9]], np.array(ROWS)[[0, 0, 1, 2]])
    save_tape(tmp_path / "tape.csv", Point, times, list(said.values()))
    again, _ = run(Outside(Point, tape=tmp_path / "tape.csv"), {})
    np.testing.assert_array_equal(again, live)


def test_what_rests_rests():
    rest = Point((0.0, 0.1, 0.2))
    np.testing.assert_array_equal(run(Outside(Point, rest), {})[0], [rest.p] * 10)
