"""A kinematic closed loop to develop on: no plant, the same algorithms.

The arm is two points (sensor's origin and tip), each a critically damped
second-order tracker with velocity feed-forward; the wall is `wall_model`'s
spring on a moving fulcrum. It runs some 50 times faster than real time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import exp, pi, sqrt

import numpy as np

from plants.abdomen.wall_motion import wave
from systems.common.signal import flat, reader, vector
from systems.common.signals import (
    Fulcrum,
    MovingPoint,
    ShaftMotion,
    ToolMotion,
    Wrench,
)
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_tracker import FulcrumTracker
from systems.passive_wrist.wrist_law import (
    DONE,
    FROZEN,
    PROBE,
    WristParams,
    command,
    constants,
    initial,
    next_state,
)

LENGTH, INSIDE = 0.40, 0.18
read_fulcrum = reader(Fulcrum)


@dataclass
class Wall:
    """A moving wall: true fulcrum and stiffness against time."""

    p0: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    amplitude: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rate: float = 0.2
    wave: str = "sine"
    phase: float = 0.0
    step: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    step_at: float = 1e9
    step_time: float = 0.02
    rise: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rise_at: float = 1e9
    rise_time: float = 5.0
    stiffness: float = 500.0
    stiffer: float = 0.0
    damping: float = 5.0
    excursion: Callable[[float], float] | None = None  # instead of rate and wave

    def position(self, t: float) -> list[float]:
        """True fulcrum in m."""
        phase = self.rate * t + self.phase
        g = self.excursion(t) if self.excursion else wave(self.wave, phase)
        s = min(max((t - self.step_at) / self.step_time, 0.0), 1.0)
        r = min(max((t - self.rise_at) / self.rise_time, 0.0), 1.0)
        r = r * r * (3 - 2 * r)
        return [
            self.p0[k] + self.amplitude[k] * g + self.step[k] * s + self.rise[k] * r
            for k in (0, 1, 2)
        ]

    def velocity(self, t: float) -> list[float]:
        """Its velocity in m/s."""
        a, b = self.position(t - 1e-4), self.position(t + 1e-4)
        return [(b[k] - a[k]) / 2e-4 for k in (0, 1, 2)]

    def stiffness_at(self, t: float) -> float:
        """True stiffness in N/m."""
        r = min(max((t - self.rise_at) / self.rise_time, 0.0), 1.0)
        return self.stiffness * (1.0 + self.stiffer * r)


@dataclass
class Case:
    """One closed-loop run."""

    wall: Wall = field(default_factory=Wall)
    fulcrum: FulcrumParams = field(default_factory=FulcrumParams)
    wrist: WristParams = field(default_factory=WristParams)
    tip: Callable[[float], tuple[list[float], list[float]]] | None = None
    duration: float = 20.0
    arm_rate: float = 8.0
    force_noise: float = 0.05
    moment_noise: float = 0.005
    bias_walk: float = 0.005
    moment_bias_walk: float = 0.0005
    delay: int = 0  # samples that the force is late
    seed: int = 0


def arcs(
    start: float, angle: float = np.deg2rad(25.0), period: float = 8.0
) -> Callable[[float], tuple[list[float], list[float]]]:
    """Altitude arcs of +-angle about the origin, from `start` on."""

    def tip(t: float) -> tuple[list[float], list[float]]:
        w = 2 * pi / period
        tau = max(t - start, 0.0)
        ramp = min(tau / 0.5, 1.0)
        a = angle * np.sin(w * tau) * ramp
        da = angle * (w * np.cos(w * tau) * ramp + np.sin(w * tau) * (tau < 0.5) * 2.0)
        if tau == 0.0:
            da = 0.0
        p = [INSIDE * np.sin(a), 0.0, -INSIDE * np.cos(a)]
        v = [INSIDE * np.cos(a) * da, 0.0, INSIDE * np.sin(a) * da]
        return [float(q) for q in p], [float(q) for q in v]

    return tip


def hold(t: float) -> tuple[list[float], list[float]]:
    """A tip that stands still below the origin."""
    return [0.0, 0.0, -INSIDE], [0.0, 0.0, 0.0]


def run(case: Case) -> dict[str, np.ndarray]:
    """Runs a case; the shaft starts unloaded at the true fulcrum."""
    rng = np.random.default_rng(case.seed)
    dt = case.fulcrum.period
    estimator = FulcrumTracker(case.fulcrum)
    law = constants(case.wrist)[0]
    z, state = estimator.initial(), initial(case.wrist)
    tip = case.tip or hold
    wall = case.wall
    p_tip, _ = tip(0.0)
    p_WI = np.array(wall.position(0.0))
    u = np.array(p_tip) - p_WI
    u /= np.linalg.norm(u)
    x = np.concatenate([np.array(p_tip) - LENGTH * u, p_tip])  # sensor, tip
    dx = np.zeros(6)
    w = 2 * pi * case.arm_rate
    decay = exp(-w * dt)
    fbias, mbias = rng.normal(0, 0.01, 3), rng.normal(0, 0.001, 3)
    late: list[tuple[np.ndarray, np.ndarray]] = []
    rows = []
    for i in range(round(case.duration / dt)):
        t = i * dt
        p_WI, v_WI = np.array(wall.position(t)), np.array(wall.velocity(t))
        p_WS = x[:3]
        shaft = x[3:] - x[:3]
        length = np.linalg.norm(shaft)
        u = shaft / length
        du = (dx[3:] - dx[:3]) / length
        du -= u * (u @ du)
        lam = u @ (p_WI - p_WS)
        r = p_WI - p_WS - lam * u
        rel = v_WI - dx[:3] - lam * du
        rel -= u * (u @ rel)
        f = wall.stiffness_at(t) * r + wall.damping * rel
        m = lam * np.cross(u, f)
        fbias += rng.normal(0, case.bias_walk * sqrt(dt), 3)
        mbias += rng.normal(0, case.moment_bias_walk * sqrt(dt), 3)
        fm = f + fbias + rng.normal(0, case.force_noise, 3)
        mm = m + mbias + rng.normal(0, case.moment_noise, 3)
        late.append((fm, mm))
        fm, mm = late[max(0, len(late) - 1 - case.delay)]
        shaft = ShaftMotion(*map(vector, (p_WS, u, dx[:3], du)))
        wrench = Wrench(vector(fm), vector(mm), 1.0)
        z = estimator.step(z, flat(shaft), flat(wrench), t)
        truth = MovingPoint(vector(p_WI), vector(v_WI))
        p_WP, v_WP = map(vector, tip(t))
        wanted = ToolMotion(p_WP, (0.0, 0.0, -1.0), v_WP, (0.0, 0.0, 0.0), t)
        report = read_fulcrum(estimator.report(z, t, flat(shaft)))
        known = case.wrist.mode == "known"
        seen = truth if known else MovingPoint(report.p, report.v)
        state = next_state(law, state, t, wanted, shaft, wrench, report, seen)
        C = estimator.covariance(z).reshape(3, 3)
        pose = command(state, wanted)
        p_d, u_d, v_d, du_d = map(np.array, pose[:4])
        goal = np.concatenate([p_d - LENGTH * u_d, p_d])
        dgoal = np.concatenate([v_d - LENGTH * du_d, v_d])
        error = report.p - p_WI
        rows.append(
            (
                t,
                float(np.linalg.norm(f)),
                float(np.linalg.norm(r)),
                *error,
                float(np.linalg.norm(error - u * (u @ error))),
                report.sigma_across,
                report.sigma_along,
                report.stiffness,
                float(error @ np.linalg.solve(C, error)),
                estimator.breathing(z),
                state[FROZEN],
                state[PROBE] * (1 - state[DONE]),
                z[estimator.at("jumps")],
                z[estimator.at("nis")],
                z[estimator.at("phase")],
                z[estimator.at("refused")],
                float(u @ error),
            )
        )
        # Exact critically damped tracking of a target that moves linearly.
        e = x - goal
        de = dx - dgoal
        e, de = (e + (de + w * e) * dt) * decay, (de - (de + w * e) * w * dt) * decay
        x, dx = goal + dgoal * dt + e, dgoal + de
    names = (
        *("t", "force", "offset", "ex", "ey", "ez", "lateral", "across", "along"),
        *("K", "nees", "rate", "frozen", "probe", "jumps", "nis", "phase"),
        *("refused", "depth"),
    )
    a = np.array(rows)
    out = {k: a[:, i] for i, k in enumerate(names)}
    out["error"] = np.linalg.norm(a[:, 3:6], axis=1)
    return out
