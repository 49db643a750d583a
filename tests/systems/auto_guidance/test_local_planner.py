"""The four blocks together: the loop's functions are the blocks, and the scenarios.

The scenarios are the paper's static and dynamic surgeon (5.1 and 5.2) and the push of
section 4.3, in the kinematic loop: exact estimates, an ideal robot.
"""

from dataclasses import dataclass
from math import dist

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput
import pytest

from diagrams.gauze.kinematic_loop import Robot, estimate
from diagrams.gauze.kinematic_planners import LocalPlanner
from diagrams.gauze.scenes import CONTACT
from plants.surgeon.surgeon_tool import SurgeonToolParams, tip_motion
from systems.auto_guidance.backward_movement import BackwardMovement
from systems.auto_guidance.fuzzy_arbiter import FuzzyArbiter
from systems.auto_guidance.go_to_target import GoToTarget, GoToTargetParams
from systems.auto_guidance.velocity_corrections import VelocityCorrections
from systems.common import geometry
from systems.common.geometry import norm
from systems.common.signal import flat, size
from systems.common.signals import Estimate, RobotTool
from tests.loosely import loosely

closest_points = loosely(geometry.closest_points)

DT = 1.0 / 60.0
G_R, START = (0.0, 0.0, 0.0), (-0.05, -0.03, -0.1)
TARGET = SurgeonToolParams(p_WG=[0.11, 0.03, 0.0], points=[[0.05, 0.03, -0.12]])
DRIFTING = SurgeonToolParams(
    p_WG=[0.11, 0.03, 0.0],
    times=[0.0, 6.0],
    points=[[0.05, 0.03, -0.12], [0.065, 0.05, -0.115]],
)
G_O = [0.02, 0.11, 0.0]
STANDING = SurgeonToolParams(p_WG=G_O, points=[[0.0, -0.005, -0.12]])
CROSSING = SurgeonToolParams(
    p_WG=G_O,
    times=[0.26, 3.06],
    points=[[0.025, -0.035, -0.097], [-0.013, 0.032, -0.127]],
)
PUSHING = SurgeonToolParams(
    p_WG=G_O,
    times=[0.3, 2.9, 4.4, 7.4],
    points=[
        [0.04, 0.0, -0.11],
        [-0.03, -0.03, -0.11],
        [-0.03, -0.03, -0.11],
        [0.03, 0.05, -0.11],
    ],
)
FULL_SPEED = GoToTargetParams().max_speed


@dataclass
class Run:
    """What was logged at the planner's instants."""

    time: np.ndarray
    tip: np.ndarray
    v: np.ndarray
    v1_tip: np.ndarray
    v_o: np.ndarray
    rho: np.ndarray
    error: np.ndarray
    weights: np.ndarray

    @property
    def speed(self):
        """Commanded speed of the tip, m/s."""
        return np.linalg.norm(self.v, axis=1)


def simulate(target, obstacle, duration, planner=None):
    """Runs a scenario with an ideal robot; rho is the distance of the surfaces."""
    planner = planner or LocalPlanner()
    robot = Robot(max_speed=FULL_SPEED)
    s_at, o_at = tip_motion(target), tip_motion(obstacle)
    tip, rows = START, []
    for k in range(round(duration / DT)):
        t = k * DT
        s, o = s_at(t), o_at(t)
        before, after = o_at(max(t - 1e-3, 0.0)), o_at(t + 1e-3)
        a = [(after[i] - before[i]) / (t + 1e-3 - max(t - 1e-3, 0)) for i in (3, 4, 5)]
        v = planner.step(
            DT,
            RobotTool(G_R, tip),
            estimate(o[:3], obstacle.p_WG, o[3:], a),
            estimate(s[:3], target.p_WG, s[3:]),
        )
        rho = closest_points(G_R, tip, obstacle.p_WG, o[:3]).distance - CONTACT
        v1_tip = np.divide(planner.v1, planner.guide.s)
        rows.append((t, tip, v, v1_tip, o[3:], rho, dist(tip, s[:3]), planner.weights))
        for _ in range(4):
            tip = robot.moved(G_R, tip, v, DT / 4)
    return Run(*(np.array(column) for column in zip(*rows, strict=True)))


def test_static_surgeon():
    r = simulate(TARGET, STANDING, 6.0)
    assert r.error[-1] < 1e-4 and r.rho.min() > 0.008
    # Straight at full speed up to the field's border ...
    border = np.argmax(r.rho < GoToTargetParams().influence_distance)
    assert r.time[border] > 0.5
    way = np.subtract(TARGET.points[0], START)
    off = np.linalg.norm(np.cross(r.tip[:border] - START, way), axis=1) / norm(way)
    assert off.max() < 1e-6
    np.testing.assert_allclose(r.speed[6:border], FULL_SPEED, rtol=0.01)
    # ... slower and aside near the obstacle ...
    dip = r.rho.argmin() + np.arange(-20, 20)
    assert r.speed[dip].min() < 0.7 * FULL_SPEED
    # ... and fast again beyond it.
    beyond = (r.time > r.time[dip[-1]]) & (r.error > 0.03)
    assert r.speed[beyond].max() > 0.99 * FULL_SPEED
    np.testing.assert_allclose(r.v, r.v1_tip, atol=1e-9)  # the field alone


def test_straight_way_of_the_static_scenario_would_touch():
    t = np.linspace(0.0, 1.0, 200)[:, None]
    tips = (1 - t) * START + t * np.array(TARGET.points[0])
    gaps = [closest_points(G_R, p, G_O, STANDING.points[0]).distance for p in tips]
    assert min(gaps) < CONTACT


def test_dynamic_surgeon():
    r = simulate(DRIFTING, CROSSING, 8.0)
    v_o, v_s = np.linalg.norm(r.v_o, axis=1), 0.026 * 1.875 / 6.0
    assert 0.05 < v_o.max() < 0.06 and v_s < 0.01
    assert r.rho.min() > 0.006
    assert r.error[-1] < 1e-4
    # Near the obstacle it is faster than the field alone: it follows the obstacle.
    near = (r.rho < 0.02) & (v_o > 0.01)
    faster = r.speed - np.linalg.norm(r.v1_tip, axis=1)
    assert (faster[near] > 0.005).sum() * DT > 0.25
    assert r.weights[near, 2].max() > 0.8
    # And it waits for the obstacle before that.
    assert faster[(r.rho > 0.02) & (r.time < 1.2)].min() < -0.01


def test_the_tip_keeps_up_with_a_drifting_target():
    away = SurgeonToolParams(p_WG=G_O, points=[[0.0, 0.1, -0.1]])
    r = simulate(DRIFTING, away, 6.0)
    assert r.error[r.time > 4.0].max() < 5e-4


def test_push():
    r = simulate(TARGET, PUSHING, 12.0)
    assert r.rho.min() > 0.006
    # It is on its way, gives way with O, ...
    pushed = (r.time > 1.6) & (r.time < 2.2)
    assert r.error[r.time < 1.5].min() < 0.075
    assert r.error[r.time > 2.9][0] > r.error[r.time < 1.5].min() + 0.01
    along_o = np.einsum("ij,ij->i", r.v, r.v_o)[pushed]
    assert along_o.min() > 0.0
    # ... stops when O stops, ...
    assert r.speed[(r.time > 4.0) & (r.time < 4.4)].max() < 2e-3
    # ... and goes on when O clears the way.
    assert r.error[-1] < 5e-4


class Replay(LeafSystem):
    """Emits a signal as a function of time."""

    def __init__(self, signal, value):
        super().__init__()
        self.DeclareVectorOutputPort(
            "y", size(signal), lambda c, y: y.SetFromVector(flat(value(c.get_time())))
        )


def add_planner(builder, ports):
    """Adds the four blocks and connects them by name; all output ports by name."""
    kinds = (GoToTarget, VelocityCorrections, BackwardMovement, FuzzyArbiter)
    blocks = [builder.AddNamedSystem(kind.__name__, kind()) for kind in kinds]
    for block in blocks:
        outputs = map(block.get_output_port, range(block.num_output_ports()))
        ports |= {port.get_name(): port for port in outputs}
    for block in blocks:
        for i in range(block.num_input_ports()):
            port = block.get_input_port(i)
            builder.Connect(ports[port.get_name()], port)
    return ports


@pytest.mark.parametrize("kind", ["CROSSING", "PUSHING"])
def test_the_drake_blocks_give_the_loops_velocities(kind):
    obstacle = {"CROSSING": CROSSING, "PUSHING": PUSHING}[kind]
    r = simulate(DRIFTING, obstacle, 3.0)
    s_at, o_at = tip_motion(DRIFTING), tip_motion(obstacle)
    # The blocks are fed what the loop saw, and must answer the same.
    planner, expected, inputs = LocalPlanner(), [], []
    for t, tip in zip(r.time, r.tip, strict=True):
        s, o = s_at(t), o_at(t)
        inputs.append(
            (
                RobotTool(G_R, tuple(tip)),
                estimate(o[:3], obstacle.p_WG, o[3:]),
                estimate(s[:3], DRIFTING.p_WG, s[3:]),
            )
        )
        planner.step(DT, *inputs[-1])
        expected.append(
            [*planner.v1, *planner.v2, *planner.v3, *planner.weights, *planner.v_R]
        )
    builder, last = DiagramBuilder(), len(inputs) - 1
    ports = {
        name: builder.AddNamedSystem(
            name,
            Replay(signal, lambda t, i=i: inputs[min(round(t / DT), last)][i]),
        ).get_output_port()
        for i, (name, signal) in enumerate(
            (("robot_tool", RobotTool), ("obstacles", Estimate), ("target", Estimate))
        )
    }
    ports = add_planner(builder, ports)
    names = ("v1", "v2", "v3", "weights", "v_R")
    logs = [LogVectorOutput(ports[name], builder, publish_period=DT) for name in names]
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(2.5)
    got = np.vstack([log.FindLog(simulator.get_context()).data() for log in logs]).T
    assert len(got) == 151
    np.testing.assert_allclose(got, np.array(expected)[: len(got)], atol=1e-12)
    # Something happened in it.
    assert np.abs(got[:, 3:6]).max() > 1e-3 and got[:, 11].max() > 0.3
