"""The chasing tool goes for the robot's shaft, through its fulcrum, at its speed."""

import numpy as np
from pydrake.systems.analysis import Simulator
import pytest

from plants.surgeon.hunting_tool import Hunt, HuntingTool
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common import geometry

TOOL = SurgeonToolParams(p_WG=[0.02, 0.11, 0.0], points=[[0.03, 0.0, -0.11]])
ROBOT = [0.0, 0.0, 0.0, -0.05, -0.03, -0.1]


def chased(hunt: Hunt, duration: float):
    """Simulator and block after some time beside a robot at rest."""
    dut = HuntingTool(TOOL, hunt)
    simulator = Simulator(dut)
    dut.GetInputPort("robot_tool").FixValue(simulator.get_mutable_context(), ROBOT)
    simulator.AdvanceTo(duration)
    return dut, simulator.get_context()


def gap(tip) -> float:
    """Distance of the tools' axes."""
    return geometry.closest_points(
        tuple(ROBOT[:3]), tuple(ROBOT[3:]), tuple(TOOL.p_WG), tuple(tip)
    )[2]


def test_it_closes_in_at_its_speed():
    hunt = Hunt(speed=0.02, start=0.5)
    dut, context = chased(hunt, 0.4)
    before = dut.GetOutputPort("shaft").Eval(context)[:3]
    np.testing.assert_allclose(before, TOOL.points[0])
    dut, context = chased(hunt, 2.0)
    shaft = dut.GetOutputPort("shaft").Eval(context)
    speed = np.linalg.norm(dut.GetOutputPort("tip_velocity").Eval(context))
    assert speed == pytest.approx(0.02)
    assert gap(before) - gap(shaft[:3]) > 0.01
    u = geometry.unit(geometry.sub(tuple(shaft[:3]), tuple(TOOL.p_WG)))
    np.testing.assert_allclose(shaft[3:], u, atol=1e-12)


def test_it_keeps_off_the_robots_fulcrum_and_ends():
    dut, context = chased(Hunt(speed=0.05, end=6.0), 6.1)
    tip = tuple(dut.GetOutputPort("shaft").Eval(context)[:3])
    off = geometry.closest_on_segment((0.0, 0.0, 0.0), tuple(TOOL.p_WG), tip)[1]
    assert off > 0.029
    assert not np.any(dut.GetOutputPort("tip_velocity").Eval(context))


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match=r"hunt: speed=-1.0 must be finite and >= 0"):
        HuntingTool(TOOL, Hunt(speed=-1.0))
    with pytest.raises(ValueError, match=r"hunt: end=0.1 s must not come before"):
        HuntingTool(TOOL, Hunt(speed=0.1, end=0.1))
