"""The chasing tool goes for the robot's shaft, through its fulcrum, at its speed."""

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from plants.surgeon.hunting_tool import Hunt, HuntingTool
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common import geometry
from systems.common.signal import flat, view
from systems.common.signals import RobotTool, Shaft

TOOL = SurgeonToolParams(p_WG=[0.02, 0.11, 0.0], points=[[0.03, 0.0, -0.11]])
ROBOT = RobotTool((0.0, 0.0, 0.0), (-0.05, -0.03, -0.1))


def chased(hunt: Hunt, duration: float):
    """Shaft and velocity after some time beside a robot at rest."""
    dut = HuntingTool(TOOL, hunt)
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    dut.GetInputPort("robot_tool").FixValue(context, flat(ROBOT))
    simulator.AdvanceTo(duration)
    shaft = view(Shaft, np.array(dut.GetOutputPort("shaft").Eval(context)))
    return shaft, np.array(dut.GetOutputPort("tip_velocity").Eval(context))


def gap(tip) -> float:
    """Distance of the tools' axes."""
    return geometry.closest_points(
        ROBOT.fulcrum, ROBOT.tip, tuple(TOOL.p_WG), tuple(tip)
    )[2]


def test_it_closes_in_at_its_speed():
    hunt = Hunt(speed=0.02, start=0.5)
    before, _ = chased(hunt, 0.4)
    np.testing.assert_allclose(before.tip, TOOL.points[0])
    shaft, v = chased(hunt, 2.0)
    assert np.linalg.norm(v) == pytest.approx(0.02)
    assert gap(before.tip) - gap(shaft.tip) > 0.01
    u = geometry.unit(geometry.sub(tuple(shaft.tip), tuple(TOOL.p_WG)))
    np.testing.assert_allclose(shaft.u, u, atol=1e-12)


def test_it_keeps_off_the_robots_fulcrum_and_ends():
    shaft, v = chased(Hunt(speed=0.05, end=6.0), 6.1)
    tip = tuple(shaft.tip)
    off = geometry.closest_on_segment((0.0, 0.0, 0.0), tuple(TOOL.p_WG), tip)[1]
    assert off > 0.029
    assert not np.any(v)


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match=r"hunt.speed=-1.0 m/s: expected >= 0"):
        HuntingTool(TOOL, Hunt(speed=-1.0))
    with pytest.raises(ValueError, match=r"hunt.end=0.1 s: expected >= start, 0.5 s"):
        HuntingTool(TOOL, Hunt(speed=0.1, end=0.1))
