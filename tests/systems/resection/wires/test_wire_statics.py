"""Wire statics, ball location and tool load as blocks."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import (
    angles_of,
    ball_posture,
    corners_of,
    turns_of,
    turns_of_angles,
)
from plants.snake.core import SnakeCoreParams
from plants.snake.equilibrium import leaps
from plants.snake.friction import flat_grip
from plants.snake.kinematics import centreline, forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.signals import BallState
from plants.snake.snake_body import body_of, place_any
from plants.snake.statics import Statics
from systems.common.parameter import ParameterError
from systems.resection.wires.ball_location import BallLocation
from systems.resection.wires.tool_load import ToolLoad, ToolLoadParams
from systems.resection.wires.wire_statics import WireStatics

PARAMS = SnakeParams()
X = posture_of([0.01, 0.4, 0.3, -1.2, 0.3, 2.5, 0.3])


def fixed(lengths, force=(0.0, 0.0, 0.0)):
    """The block at a posture's lengths, all at rest."""
    dut = WireStatics(posture=X)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("lengths").FixValue(context, lengths)
    dut.GetInputPort("rates").FixValue(context, np.zeros(10))
    dut.GetInputPort("force").FixValue(context, force)
    return dut, context


def test_it_follows_wires_and_force():
    wound = np.append(wire_lengths(X, PARAMS) - 2e-4, X[0])
    dut, context = fixed(wound)
    location = BallLocation()
    where = location.CreateDefaultContext()
    tools = []
    for f in (0.0, 0.05):
        dut.GetInputPort("force").FixValue(context, [f, 0.0, 0.0])
        least, lost = dut.GetOutputPort("stability").Eval(context)
        assert least > 0.0 == lost
        state = dut.GetOutputPort("desired_state").Eval(context)
        location.GetInputPort("state").FixValue(where, state)
        tools.append(location.GetOutputPort("tool").Eval(where)[:3])
    assert np.linalg.norm(tools[0] - forward(X, PARAMS)[:3, 3]) < 5e-3
    assert tools[1][0] - tools[0][0] > 1e-4


def test_location_is_the_papers_for_balls_that_turn_alike():
    dut = BallLocation()
    context = dut.CreateDefaultContext()
    q = np.append(X[0], angles_of(turns_of(X)))
    state = BallState(tuple(q), (0.0,) * 19)
    dut.GetInputPort("state").FixValue(context, np.concatenate(state))
    X_WT = forward(X, PARAMS)
    tool = dut.GetOutputPort("tool").Eval(context)
    np.testing.assert_allclose(tool[:3], X_WT[:3, 3], atol=1e-14)
    np.testing.assert_allclose(tool[3:], X_WT[:3, 2], atol=1e-14)
    np.testing.assert_allclose(dut.GetOutputPort("gaps").Eval(context), 0, atol=1e-14)


def test_what_is_no_number_moves_nothing():
    dut, context = fixed([np.nan] * 10)
    desired = dut.GetOutputPort("desired_state").Eval(context)
    np.testing.assert_allclose(
        desired[:19], np.append(X[0], angles_of(turns_of(X))), atol=1e-15
    )
    assert dut.GetOutputPort("stability").Eval(context)[1] == 1.0


def test_load_grows_steadily():
    dut = ToolLoad(ToolLoadParams([0.2, 0.0, -0.1], start=1.0, end=3.0))
    context = dut.CreateDefaultContext()
    for time, share in ((0.0, 0.0), (2.0, 0.5), (9.0, 1.0)):
        context.SetTime(time)
        f = dut.GetOutputPort("force").Eval(context)
        np.testing.assert_allclose(f, share * np.array([0.2, 0.0, -0.1]))
    with pytest.raises(ParameterError, match=r"end=1\.0 s: expected > start"):
        ToolLoad(ToolLoadParams(start=2.0, end=1.0))


@pytest.mark.parametrize("more", [1e-4, 3e-4, 8e-4])
def test_buckling_is_told_from_a_long_way(more):
    """Winding on bends the snake; more pretension buckles it, on a soft core."""
    snake = Statics(core=SnakeCoreParams(bend=0.02, twist=0.0155))
    here, there = (wire_lengths(x, PARAMS) - 5e-5 for x in (0.2 * X, 0.5 * X))
    no = np.zeros(3)
    grip = flat_grip(snake.equilibrium(turns_of(0.2 * X), wound=here).grip)
    bent, pulled = (np.append(way, no) for way in (there, here - more))

    def leap(now):
        k = snake.drive.wire_stiffness
        return leaps(grip, k, np.append(here, no), now, snake.record[0])

    assert not leap(bent)
    assert leap(pulled)


def test_true_balls_are_where_the_paper_has_them():
    """The body's corners of balls that turn alike, and of some that do not."""
    body, out = body_of(PARAMS), np.empty((8, 3))
    place_any(body, ball_posture(X), out)
    np.testing.assert_allclose(out, centreline(X, PARAMS), atol=1e-12)
    q = ball_posture(X) + 0.1 * np.sin(np.arange(19))
    place_any(body, q, out)
    expected = corners_of(turns_of_angles(q[1:]), q[0], PARAMS)
    np.testing.assert_allclose(out, expected, atol=1e-12)
