"""The robot is a unicycle with limits, integrated by Drake."""

from math import cos, sin

import numpy as np
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
import pytest

from plants.turtlebot.signals import Command, RobotState
from plants.turtlebot.turtlebot import BODIES, TurtlebotParams, make_turtlebot
from systems.common.parameter import check


def drive(speed, rate, duration, start=(1.0, 2.0, 0.5)):
    robot = make_turtlebot(TurtlebotParams(), list(start))
    context = robot.CreateDefaultContext()
    robot.get_input_port().FixValue(context, [speed, rate])
    simulator = Simulator(robot, context)
    simulator.AdvanceTo(duration)
    return robot.get_output_port().Eval(simulator.get_context())


def test_it_starts_where_it_is_put():
    np.testing.assert_allclose(drive(0.0, 0.0, 0.1), [1.0, 2.0, 0.5, 0.0, 0.0])


def test_it_accelerates_and_keeps_its_greatest_speed():
    assert drive(9.0, 0.0, 0.2)[3] == pytest.approx(0.2, abs=0.01)  # 1 m/s^2
    x, y, _, v, _ = drive(9.0, 0.0, 5.0)
    assert v == pytest.approx(0.5, abs=1e-6)
    assert (x - 1.0) * sin(0.5) == pytest.approx((y - 2.0) * cos(0.5), abs=1e-6)
    # Half a second to speed up costs an eighth of a metre.
    assert np.hypot(x - 1.0, y - 2.0) == pytest.approx(2.5 - 0.125, abs=0.005)


def test_it_drives_circles():
    state = drive(0.5, 1.0, 2.0 * np.pi + 2.0)
    later = drive(0.5, 1.0, 4.0 * np.pi + 2.0)
    np.testing.assert_allclose(later[:2], state[:2], atol=5e-3)
    assert drive(0.0, 9.0, 3.0)[4] == pytest.approx(1.8, abs=1e-6)


def test_bad_parameters_are_refused():
    for change, message in (
        ({"acceleration": -1.0}, r"robot.acceleration=-1.0 m/s\^2: expected > 0"),
        ({"radius": 1e9}, r"robot.radius=1000000000.0 m: expected >= 0.05 and <= 1;"),
        ({"lag": 1e-4}, r"robot.lag=0.0001 s: expected >= 0.02"),
    ):
        with pytest.raises(ValueError, match=message):
            make_turtlebot(TurtlebotParams(**change), [0.0, 0.0, 0.0])


def test_the_shortest_lag_is_stable_at_the_step_of_the_navigation():
    params = TurtlebotParams(lag=0.02, acceleration=10.0)
    robot = make_turtlebot(params, [0.0, 0.0, 0.0])
    context = robot.CreateDefaultContext()
    robot.get_input_port().FixValue(context, Command(0.4, 0.3))
    simulator = Simulator(robot, context)
    config = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=0.05, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    simulator.AdvanceTo(3.0)
    state = RobotState(*robot.get_output_port().Eval(simulator.get_context()))
    assert (state.v, state.omega) == pytest.approx((0.4, 0.3), abs=0.01)


def test_a_model_gives_the_numbers_that_nobody_gave():
    body = TurtlebotParams(model="turtlebot4", lag=0.1, speed=0.3)
    assert (body.radius, body.speed, body.lag) == (0.171, 0.3, 0.1)
    for name in BODIES:
        check(TurtlebotParams(name))
