"""Tube and snake: kinematics against the plant's, and the way out and back."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
import pytest

from plants.arm.arm import servo_step
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.tube import TubeParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolTarget
from plants.snake.snake import add_snake
from systems.common.geometry import Pose
from systems.common.signal import example, flat, vector, view
from systems.common.signals import ToolMotion
from systems.keyhole.phases import Phases
from systems.keyhole.signals import Phase, SnakeStatus, TubePose, TubeStatus
from systems.keyhole.snake_load import weight_of
from systems.keyhole.snake_task import (
    SnakeTask,
    SnakeTaskParams,
    body_deviation,
    in_channel,
)
from systems.keyhole.tube_location import TubeLocation
from systems.keyhole.tube_task import TubeTask, TubeTaskParams
from systems.sensing.organ_estimator import OrganMotion


def test_tube_pose_is_the_plants():
    rng = np.random.default_rng(1)
    tube = TubeParams()
    plant = make_controller_plant(instrument=tube)
    context = plant.CreateDefaultContext()
    dut = TubeLocation(tube)
    own = dut.CreateDefaultContext()
    A, C = servo_step(plant, READY_POSTURE, None, 1 / 120)
    for _ in range(5):
        q_d = np.array(READY_POSTURE) + rng.uniform(-0.4, 0.4, 7)
        lag, step, v = rng.uniform(-0.01, 0.01, (3, 7))
        dut.GetInputPort("arm_state").FixValue(own, [*(q_d + lag), *v])
        dut.GetInputPort("posture").FixValue(own, q_d)
        dut.GetInputPort("next").FixValue(own, q_d + step)
        seen = view(TubePose, np.array(dut.GetOutputPort("tube").Eval(own)))
        plant.SetPositions(context, q_d + step + A @ lag + C @ (v / 120 - step))
        X = plant.GetFrameByName(INSTRUMENT_TIP).CalcPoseInWorld(context)
        np.testing.assert_allclose(seen.p, X.translation(), atol=1e-12)
        np.testing.assert_allclose(seen.x, X.rotation().col(0), atol=1e-12)
        np.testing.assert_allclose(seen.z, X.rotation().col(2), atol=1e-12)


def test_weight_of_the_straight_snake():
    plant = MultibodyPlant(0.0)
    snake, drive = SnakeParams(), SnakeDriveParams()
    instance = add_snake(plant, plant.world_frame(), snake, drive).instance
    plant.Finalize()
    context = plant.CreateDefaultContext()
    mass, centre = weight_of(snake, drive)
    assert plant.CalcTotalMass(context, [instance]) == pytest.approx(mass)
    p = plant.CalcCenterOfMassPositionInWorld(context, [instance])
    assert p[2] == pytest.approx(centre)


def test_a_target_in_the_organ_is_one_in_the_channel():
    rng = np.random.default_rng(2)
    for _ in range(5):
        A, B = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
        R_WE, R_WC = (R * np.sign(np.linalg.det(R)) for R in (A, B))
        p_WE, p_WP, p_E = rng.normal(size=(3, 3))
        tube = TubePose(*map(vector, (p_WP, R_WC[:, 0], R_WC[:, 2])))
        target = ToolTarget(vector(p_E), *map(vector, np.eye(3)[:2]))
        E = Pose(*map(vector, (p_WE, *R_WE.T)))
        out = in_channel(target, E, tube, 0.04)
        p_WC = p_WP + 0.04 * R_WC[:, 2]
        np.testing.assert_allclose(p_WC + R_WC @ out.p, p_WE + R_WE @ p_E, atol=1e-12)
        np.testing.assert_allclose(R_WC @ out.n, R_WE[:, 0], atol=1e-12)


class Played:
    """A snake task with a tube and an organ where they are told to be."""

    def __init__(self) -> None:
        self.dut = SnakeTask()
        self.simulator = Simulator(self.dut)
        self.context = self.simulator.get_mutable_context()
        self.tube = np.array([0.0, 0.0, -0.08, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0])
        self.organ = flat(example(OrganMotion))

    def play(self, phase: Phases, seconds: float) -> tuple[SnakeStatus, ToolTarget]:
        """Status and target after some more time in a phase."""
        ports = {"phase": flat(Phase(float(phase), 0.0, 0.0, 1.0))}
        ports |= {"tube": self.tube, "organ": self.organ}
        for name, value in ports.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        self.simulator.AdvanceTo(self.context.get_time() + seconds)
        read = [
            np.array(self.dut.GetOutputPort(name).Eval(self.context))
            for name in ("status", "target")
        ]
        return view(SnakeStatus, read[0]), view(ToolTarget, read[1])


def test_the_snake_stays_in_its_tube_but_for_the_gate():
    played = Played()
    for phase in (Phases.PROBE, Phases.APPROACH, Phases.STATION, Phases.STOPPED):
        status, target = played.play(phase, 1.0)
        assert status.out == 0.0
        assert target.p[2] + SnakeParams().tool_radius < -0.04  # C: the tube's end


def test_the_snake_makes_up_for_the_tube():
    played = Played()
    whole = played.dut.time / 2
    status, before = played.play(Phases.RESECT, whole)
    assert status.out == 1.0
    played.organ[:3] += [0.002, -0.001, 0.003]
    _, after = played.play(Phases.RESECT, 1e-9)
    # C's z axis is the world's -z, its y axis the world's -y.
    np.testing.assert_allclose(after.p - before.p, [0.002, 0.001, -0.003], atol=2e-4)


def test_the_body_leaves_its_plan_as_the_tube_does():
    """Some 0.04 mm a degree, and a third of how far it stands aside."""
    x = np.array([-0.01, 0.2, -0.3, 0.3, 0.2, 0.4, -0.1])
    E = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    snake = SnakeParams()
    geometry = snake.half_pitch, snake.tool_offset, snake.max_bend
    assert body_deviation(x, E, E, *geometry) < 1e-12
    c, s = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
    tilted = Pose((0.0, 0.0, 0.0), (c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))
    assert 2e-5 < body_deviation(x, tilted, E, *geometry) < 6e-5
    aside = E._replace(p=(5e-4, 0.0, 0.0))
    assert 1e-4 < body_deviation(x, aside, E, *geometry) < 2e-4


def test_a_stop_draws_the_tool_back():
    played = Played()
    before, _ = played.play(Phases.RESECT, played.dut.time / 2)
    status, _ = played.play(Phases.STOPPED, 0.2)
    assert status.retreat == 1.0
    clock = status.clock
    assert clock == pytest.approx(before.clock - SnakeTaskParams().retreat, abs=0.02)
    status, _ = played.play(Phases.STOPPED, 2.0)
    assert status.clock == clock
    status, _ = played.play(Phases.RETRACT, 40.0)
    assert status.out == 0.0 and status.retreat == 0.0


def test_an_alarm_is_not_waited_for_by_a_phase():
    """The tool loses its power and turns back while the phase is still RESECT."""
    played = Played()
    cutting = played.dut.GetOutputPort("cutting")
    before, _ = played.play(Phases.RESECT, played.dut.time / 2)
    assert cutting.Eval(played.context)[0] == 1.0
    alarm = list(OrganMotion._fields).index("alarm") - len(OrganMotion._fields)
    played.organ[alarm] = 1.0
    status, _ = played.play(Phases.RESECT, 0.2)
    assert cutting.Eval(played.context)[0] == 0.0
    assert status.retreat == 1.0 and status.clock < before.clock


def test_the_tube_follows_its_station():
    params = TubeTaskParams(standoff=0.05)
    dut = TubeTask(params, p_WP=(0.0, 0.0, -0.06))
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    organ = example(OrganMotion)._replace(p=(0.003, 0.0, -0.12), v=(0.01, 0.0, 0.0))
    dut.GetInputPort("organ").FixValue(context, flat(organ))
    dut.GetInputPort("snake").FixValue(context, flat(example(SnakeStatus)))
    for phase in (Phases.PROBE, Phases.APPROACH):
        code = flat(Phase(float(phase), 0.0, 0.0, 1.0))
        dut.GetInputPort("phase").FixValue(context, code)
        simulator.AdvanceTo(context.get_time() + 3.0)
        tool = view(ToolMotion, np.array(dut.GetOutputPort("tool").Eval(context)))
        if phase == Phases.PROBE:
            np.testing.assert_allclose(tool.tip, [0.0, 0.0, -0.06], atol=1e-12)
    np.testing.assert_allclose(tool.tip, [0.003, 0.0, -0.07], atol=1e-9)
    np.testing.assert_allclose(tool.v, [0.01, 0.0, 0.0], atol=1e-9)
    status = view(TubeStatus, np.array(dut.GetOutputPort("status").Eval(context)))
    assert status.distance < 1e-9
