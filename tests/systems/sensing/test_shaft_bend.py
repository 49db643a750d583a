"""The bend that is reckoned, against a beam's."""

import numpy as np
import pytest

from plants.instruments.instrument import InstrumentParams
from systems.common.signal import flat, view
from systems.common.signals import Bend, ShaftMotion, ToolMotion, Wrench
from systems.motion.straight_tool import straightened
from systems.sensing.shaft_bend import ShaftBend

EI, U, P = 5.3, np.array([0.6, 0.0, -0.8]), np.array([0.1, 0.2, 0.3])
ACROSS = np.array([0.8, 0.0, 0.6])
STILL = (0.0, 0.0, 0.0)


def reckoned(force, at, weightless=True):
    """Outputs of the block for a force at a place of the shaft."""
    mass = {"shaft_mass": 0.005} if weightless else {}
    tool = InstrumentParams(bending_stiffness=EI, **mass)
    dut = ShaftBend(None, tool)
    context = dut.CreateDefaultContext()
    shaft = ShaftMotion(tuple(P), tuple(U), STILL, STILL)
    wrench = Wrench(tuple(force), tuple(np.cross(at * U, force)), 1.0)
    for name, told in (("shaft", shaft), ("wrench", wrench)):
        dut.GetInputPort(name).FixValue(context, flat(told))
    names = {"bent_shaft": ShaftMotion, "bent_wrench": Wrench, "bend": Bend}
    return tool, *(
        view(kind, dut.GetOutputPort(name).Eval(context))
        for name, kind in names.items()
    )


def test_a_force_at_the_tip_bends_it_as_it_does_a_beam():
    tool, line, there, bend = reckoned(ACROSS, 0.4)
    long = tool.length - tool.mount_length
    # The light shaft's own weight, 5 g, is 2 % of the newton.
    assert bend.tip @ ACROSS == pytest.approx(long**3 / (3.0 * EI), rel=0.02)
    assert np.linalg.norm(bend.turn) == pytest.approx(long**2 / (2.0 * EI), rel=0.02)
    # To who is told line and wrench the shaft is straight: the force is at the tip.
    tip = np.add(line.p, tool.length * np.array(line.u))
    np.testing.assert_allclose(tip, P + tool.length * U + bend.tip, atol=1e-12)
    lever = np.cross(line.u, there.f)
    assert there.m @ lever / (lever @ lever) == pytest.approx(tool.length, abs=1e-4)


def test_its_own_weight_bends_it():
    tool, *_, bend = reckoned(np.zeros(3), 0.0, weightless=False)
    piece = tool.length - tool.bend_joint
    sag = 9.81 * tool.bent_mass * U[0] * piece / 2.0 * piece / tool.bend_stiffness
    assert np.linalg.norm(bend.tip) == pytest.approx(sag, rel=1e-3)
    assert bend.tip[2] < 0.0


def test_a_silent_sensor_leaves_the_bend_as_it_was_and_says_so():
    _, line, there, bend = reckoned(np.full(3, np.nan), 0.3)
    assert there.valid == 0.0
    assert np.isfinite([*line.p, *line.u, *there.f, *there.m, *bend.tip]).all()


def test_the_arm_is_sent_where_the_bent_tip_is_right():
    bend = Bend((1e-3, -2e-3, 0.0), (0.0, 4e-3, 1e-3))
    wanted = ToolMotion((0.1, 0.0, -0.1), tuple(U), STILL, STILL, 1.0)
    told = straightened(wanted, bend)
    np.testing.assert_allclose(np.add(told.tip, bend.tip), wanted.tip)
    turned = np.add(told.u, np.cross(bend.turn, told.u))
    np.testing.assert_allclose(turned, U, atol=5e-5)
    assert np.linalg.norm(told.u) == pytest.approx(1.0)
