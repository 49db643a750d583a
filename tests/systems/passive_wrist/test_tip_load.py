"""Tip and wall told apart: detection, false alarms, the trocar's torque."""

import numpy as np
import pytest

from systems.common import geometry
from systems.common.signal import example, flat, view
from systems.common.signals import Fulcrum, ShaftMotion, Wrench
from systems.passive_wrist.tip_load import TipForce, TipLoad, TipLoadParams, tilt

LENGTH, DEPTH, PERIOD = 0.4, 0.25, 1.0 / 120.0


class Bench:
    """The block under a shaft that swings about its fulcrum, the wrench made up."""

    def __init__(self, seed=1, stiffness=0.0, active=True):
        self.rng, self.k, self.time = np.random.default_rng(seed), stiffness, 0.0
        self.dut = TipLoad(TipLoadParams(active=active))
        self.context = self.dut.CreateDefaultContext()

    def step(self, f_tip=(0.0, 0.0, 0.0), f_wall=(0.0, 0.0, 0.0)):
        """One reading; what the block tells, and the wrench without its noise."""
        angle = 0.3 + 0.2 * np.sin(1.5 * self.time)
        u = (np.sin(angle), 0.1 * np.sin(self.time), -np.cos(angle))
        u = geometry.unit(u)
        p = geometry.along((0.0, 0.0, 0.0), -DEPTH, u)
        tip, wall = (geometry.across(f, u) for f in (f_tip, f_wall))
        f = geometry.plus(tip, wall)
        m = geometry.plus(
            geometry.along(
                geometry.scaled(DEPTH, geometry.cross(u, wall)),
                LENGTH,
                geometry.cross(u, tip),
            ),
            geometry.scaled(-self.k, tilt(u)),
        )
        noise = self.rng.normal(0.0, (0.05,) * 3 + (0.005,) * 3)
        wrench = Wrench(
            geometry.plus(f, tuple(noise[:3])), geometry.plus(m, tuple(noise[3:])), 1.0
        )
        fulcrum = example(Fulcrum)._replace(p=(0.0, 0.0, 0.0), sigma_along=1e-3)
        shaft = example(ShaftMotion)._replace(p=p, u=u)
        for name, signal in (
            ("shaft", shaft),
            ("wrench", wrench),
            ("estimate", fulcrum),
        ):
            self.dut.GetInputPort(name).FixValue(self.context, flat(signal))
        told = [
            view(kind, np.array(self.dut.GetOutputPort(name).Eval(self.context)))
            for name, kind in (("wall", Wrench), ("tip_force", TipForce))
        ]
        after = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.SetDiscreteState(after)
        self.time += PERIOD
        return *told, wrench, wall, u


def test_a_touch_is_told_in_time_and_the_wall_keeps_its_own():
    for seed, stiffness in ((1, 0.0), (2, 0.5)):
        bench = Bench(seed, stiffness)
        for _ in range(480):
            _, tip, *_ = bench.step()
            assert tip.contact == 0.0
        push, errors = (0.0, 0.5, 0.0), []
        for k in range(240):
            wall, tip, _, true, u = bench.step(push, (0.1, 0.0, 0.0))
            assert tip.contact == 1.0 or k < 12  # 0.1 s
            if k > 24:
                errors.append(geometry.sub(tip.f, geometry.across(push, u)))
                assert geometry.norm(geometry.sub(wall.f, true)) < 0.4
        assert np.sqrt(np.mean(np.sum(np.square(errors), axis=1))) < 0.12
        for _ in range(60):
            _, tip, *_ = bench.step()
        assert tip.contact == 0.0
        assert tip.torque_stiffness == pytest.approx(stiffness, abs=0.05)


def test_no_false_alarm_in_half_a_minute():
    bench = Bench(3, 0.3)
    for k in range(30 * 120):
        f_wall = (0.1 * np.sin(0.01 * k), 0.1, 0.0)
        _, tip, *_ = bench.step(f_wall=f_wall)
        assert tip.contact == 0.0


def test_switched_off_it_passes_the_wrench_and_feels_nothing():
    bench = Bench(active=False)
    wall, tip, wrench, *_ = bench.step((0.0, 1.0, 0.0))
    np.testing.assert_array_equal(flat(wall), flat(wrench))
    assert tip.contact == 0.0 and not np.any(tip.f)
