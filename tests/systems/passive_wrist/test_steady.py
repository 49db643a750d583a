"""An estimate that is good for minutes, under a tip that moves with the breath."""

from functools import cache
from math import cos, pi, sin

import numpy as np
import pytest

from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.steady import SIZE, TOLD, unexplained
from systems.passive_wrist.wrist_law import WristParams
from tests.systems.passive_wrist.wrist_loop import INSIDE, Case, Wall, run

RATE = 0.25


def follow(t: float) -> tuple[list[float], list[float]]:
    """A tip that follows an organ in antiphase to the wall, from 10 s on."""
    share = min(max((t - 10.0) / 5.0, 0.0), 1.0)
    share = share * share * (3.0 - 2.0 * share)
    w = 2.0 * pi * RATE
    g, dg = -share * sin(w * t), -share * w * cos(w * t)
    return [0.005 * g, 0.0, 0.008 * g - INSIDE], [0.005 * dg, 0.0, 0.008 * dg]


@cache
def loop(steady: bool, seed: int, duration: float) -> dict[str, np.ndarray]:
    guess = [0.006, 0.0, 0.01]
    return run(
        Case(
            wall=Wall(amplitude=[0.005, 0.0, 0.008], rate=RATE),
            tip=follow,
            fulcrum=FulcrumParams(guess=guess, steady=steady),
            wrist=WristParams(guess=guess),
            duration=duration,
            bias_walk=0.004,
            moment_bias_walk=0.0004,
            seed=seed,
        )
    )


def drift(a: dict[str, np.ndarray]) -> float:
    """How far the depth's error runs in the last 40 s, in m."""
    early = (a["t"] > 30.0) & (a["t"] < 42.0)
    return abs(float(a["depth"][-1440:].mean() - a["depth"][early].mean()))


def test_the_depth_does_not_run_away():
    assert drift(loop(False, 1, 80.0)) > 6e-3
    steady = loop(True, 1, 80.0)
    assert drift(steady) < 3e-3
    late = steady["t"] > 20.0
    assert np.sqrt((steady["force"][late] ** 2).mean()) < 0.06
    assert steady["refused"][-1] == 0


def test_the_observer_explains_what_repeats_and_not_what_does_not():
    s, w, dt = np.zeros(SIZE), 2.0 * pi * RATE, 1 / 120
    for i in range(120 * 60):
        t = i * dt
        p = (0.005 * sin(w * t), 0.002 * cos(2 * w * t), -0.09)
        v = (0.005 * w * cos(w * t), -0.004 * w * sin(2 * w * t), 0.0)
        rest = unexplained(s, p, v, w, dt)
        s[TOLD] = 1.0
    assert np.linalg.norm(rest) < 5e-4
    rest = unexplained(s, p, (v[0] + 0.01, *v[1:]), w, dt)
    assert rest[0] == pytest.approx(0.01, abs=5e-4)


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_half_an_hour(seed):
    steady = loop(True, seed, 1800.0)
    late = steady["t"] > 20.0
    assert np.sqrt((steady["force"][late] ** 2).mean()) < 0.15
    assert steady["force"][late].max() < 1.0
    assert steady["refused"][-1] == 0
