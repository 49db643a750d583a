"""The sensor under the drive pack and what is told from it, beside the drums."""

import numpy as np
import pytest

from plants.snake.actuation import wire_lengths
from plants.snake.balls import angles_of, tool_pose, turns_of
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.signals import Posture
from plants.snake.statics import Statics
from plants.snake.weight import weight
from systems.common.compiled import packed
from systems.resection.wires.base_sensor import BaseSensor, BaseWrench, scale
from systems.resection.wires.contact_watch import MOST, ContactWatchParams, _step

SNAKE, DRIVE = SnakeParams(), SnakeDriveParams()
BENT = posture_of([0.01, 0.4, 0.3, -1.2, 0.3, 2.5, 0.3])


def wrench(x, force=(0.0, 0.0, 0.0), noise=(0.0,) * 6):
    """What the sensor reads of a snake in a posture (7,)."""
    dut = BaseSensor()
    context = dut.CreateDefaultContext()
    state = np.concatenate([[x[0]], angles_of(turns_of(x)), np.zeros(19)])
    for port, value in (("state", state), ("force", force), ("noise", noise)):
        dut.GetInputPort(port).FixValue(context, value)
    return np.array(dut.GetOutputPort("wrench").Eval(context))


def test_it_reads_weight_and_force():
    free, pushed = wrench(BENT), wrench(BENT, (0.2, 0.0, -0.1))
    mass = DRIVE.carriage_mass + 6 * (DRIVE.ball_mass + DRIVE.plate_mass)
    assert free[2] == pytest.approx(-9.81 * (mass + DRIVE.tool_mass))
    p = tool_pose(turns_of(BENT), BENT[0], SNAKE)[:3, 3]
    np.testing.assert_allclose(pushed[:3] - free[:3], [0.2, 0.0, -0.1], atol=1e-12)
    np.testing.assert_allclose(
        pushed[3:] - free[3:], np.cross(p, [0.2, 0.0, -0.1]), atol=1e-12
    )
    # What turns a1, about x through both balls of a straight module, is twice the
    # moment about x.
    straight = posture_of([0.0, 0.4, 0.0, 0.0, 0.0, 2.0, 0.3])
    torque = weight(straight, SNAKE, DRIVE)[1]
    assert torque == pytest.approx(2 * wrench(straight)[3], abs=1e-9)
    assert abs(torque) > 1e-6


def watched(forces, deviation, seed):
    """Flags of the watch on forces (n, 3) and a sensor's noise in N."""
    rng = np.random.default_rng(seed)
    params, model = packed(ContactWatchParams())[0], scale(SNAKE, DRIVE)[0]
    rest, state = wrench(BENT), np.zeros(7 + 6 * MOST)
    read = rest[:3] + forces + deviation * rng.standard_normal(forces.shape)
    flags, m = [], tuple(rest[3:].tolist())
    posture = Posture(tuple(BENT.tolist()))
    for f in read.tolist():
        state, contact = _step(params, model, state, BaseWrench(tuple(f), m), posture)
        flags.append(contact.flag)
    return np.array(flags) != 0.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_touch_of_0_2_N_is_felt_within_0_2_s_and_nothing_else(seed):
    """Ten minutes at 50 Hz, and a touch at their end; 0.02 N of noise an axis."""
    forces = np.zeros((30_050, 3))
    forces[30_000:] = 0.2 * np.array([0.6, 0.0, 0.8])
    flags = watched(forces, 0.02, seed)
    assert not flags[:30_000].any()
    assert 0.02 * np.argmax(flags[30_000:]) <= 0.2


def test_ten_times_the_noise_alarms_falsely():
    assert watched(np.zeros((3_000, 3)), 0.2, 1).any()


def test_drums_do_not_feel_it():
    """0.2 N changes the drums' tensions by less than their history does."""
    model = Statics(
        drive=SnakeDriveParams(pretension=0.3),
        friction=SnakeFrictionParams(wire=0.1, socket=0.1),
    )

    def at(betas, force=(0.0, 0.0, 0.0)):
        grip, turns = None, turns_of(np.zeros(7))
        for beta in betas:
            x = posture_of([0.0, 0.7, beta, -1.3, beta / 2, 2.7, beta / 3])
            wound = wire_lengths(x, SNAKE) - 5e-5
            found = model.equilibrium(turns, wound=wound, force=force, grip=grip)
            turns, grip = found.turns, found.grip
        return found.T

    up = np.linspace(0.0, 0.3, 16)
    there, back = (
        at(up),
        at([*up, *np.linspace(0.3, 0.5, 11), *np.linspace(0.5, 0.3, 11)]),
    )
    history = np.abs(back - there).max()
    touch = max(np.abs(at(up, f) - there).max() for f in 0.2 * np.eye(3))
    assert touch < history
