"""Bounds of the tensions at the tips, on a snake that is bent to and fro."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import turns_of
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.statics import Statics
from systems.resection.wires.tension_estimator import (
    TensionEstimator,
    TensionEstimatorParams,
)

BETAS = 0.3 * np.sin(np.linspace(0.0, 4.0 * np.pi, 81))


@pytest.fixture(scope="module")
def way():
    """Postures, tensions at the drums and at the tips, (n, 7), (n, 9) twice."""
    model = Statics(
        drive=SnakeDriveParams(pretension=0.3),
        friction=SnakeFrictionParams(wire=0.1, socket=0.1),
    )
    rows, grip, turns = [], None, turns_of(np.zeros(7))
    for beta in BETAS:
        x = posture_of([0.0, 0.7, beta, -1.3, beta, 2.7, beta])
        wound = wire_lengths(x, SnakeParams()) - 5e-5
        found = model.equilibrium(turns, wound=wound, grip=grip)
        turns, grip, tip = found.turns, found.grip, found.T.copy()
        for w in range(9):
            for P in found.P[: 2 * (w // 3 + 1), w]:
                tip[w] = 2 * P - tip[w]
        rows.append((x, found.T, tip))
    return [np.array(column) for column in zip(*rows, strict=True)]


def bounds(way, **params):
    """Share of the tips' tensions within their bounds, and the median width in N."""
    dut = TensionEstimator(TensionEstimatorParams(**params))
    context, found = dut.CreateDefaultContext(), []
    for x, T, _ in zip(*way, strict=True):
        dut.GetInputPort("posture").FixValue(context, x)
        dut.GetInputPort("tension").FixValue(context, T)
        found.append(np.array(dut.GetOutputPort("interval").Eval(context)))
        new = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(0, np.array(new.get_vector(0).value()))
    lower, upper = np.split(np.array(found), 2, axis=1)
    inside = (lower - 1e-4 <= way[2]) & (way[2] <= upper + 1e-4)
    return inside.mean(), np.median(upper - lower)


def test_tips_are_within_their_bounds(way):
    share, width = bounds(way)
    assert share == 1.0
    known, narrower = bounds(way, sure=1e-3)
    assert known > 0.95 and narrower < width


def test_a_wrong_coefficient_that_is_trusted_gives_wrong_bounds(way):
    assert bounds(way, wire=0.07, doubt=0.0, margin=0.0)[0] < 0.9
    assert bounds(way, wire=0.07, doubt=0.5)[0] == 1.0
