"""An estimate that is good for minutes, under a tip that moves with the breath."""

from functools import cache

import numpy as np

from plants.abdomen.breath import Irregular
from plants.abdomen.wall_motion import WallMotionParams
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.wrist_law import WristParams
from tests.systems.passive_wrist.wrist_loop import INSIDE, Case, Wall, run

ORGAN = np.array([0.005, 0.0, 0.008])
PERIOD = 1.0 / 60.0


@cache
def loop(
    steady: bool, duration: float, wave: str = "sine", jitter: float = 0.0
) -> dict[str, np.ndarray]:
    """A wall, and a tip that follows an organ in antiphase to it from 10 s on."""
    irregular = Irregular(jitter=jitter, seed=1)
    motion = WallMotionParams(rate=0.25, wave=wave, irregular=irregular)

    def place(t: float) -> np.ndarray:
        share = min(max((t - 10.0) / 5.0, 0.0), 1.0)
        g = share * share * (3.0 - 2.0 * share) * motion.excursion(t, 0.5)
        return g * ORGAN - [0.0, 0.0, INSIDE]

    def follow(t: float) -> tuple[list[float], list[float]]:
        v = (place(t + 1e-3) - place(t - 1e-3)) / 2e-3
        return place(t).tolist(), v.tolist()

    guess = [0.006, 0.0, 0.01]
    return run(
        Case(
            wall=Wall(amplitude=ORGAN.tolist(), excursion=motion.excursion),
            tip=follow,
            fulcrum=FulcrumParams(guess=guess, steady=steady, period=PERIOD),
            wrist=WristParams(guess=guess, period=PERIOD),
            duration=duration,
            bias_walk=0.004,
            moment_bias_walk=0.0004,
            seed=1,
        )
    )


def drift(a: dict[str, np.ndarray]) -> float:
    """How far the depth's error runs in the last 40 s, in m."""
    early, late = (a["t"] > 30.0) & (a["t"] < 42.0), a["t"] > a["t"][-1] - 12.0
    return abs(float(a["depth"][late].mean() - a["depth"][early].mean()))


def test_the_depth_does_not_run_away():
    assert drift(loop(False, 80.0)) > 4e-3
    steady = loop(True, 80.0)
    assert drift(steady) < 3e-3
    late = steady["t"] > 20.0
    assert np.sqrt((steady["force"][late] ** 2).mean()) < 0.06
    assert steady["refused"][-1] == 0


def test_a_jittering_ventilator_is_no_message_of_the_depth():
    """What no harmonic foresees of a wave looks like a depth of 30 mm more."""
    a = loop(True, 120.0, "ventilator", 0.05)
    late = a["t"] > 20.0
    assert np.abs(a["depth"][late]).max() < 20e-3
    assert np.sqrt((a["force"][late] ** 2).mean()) < 0.1
    assert a["force"][late].max() < 0.7
