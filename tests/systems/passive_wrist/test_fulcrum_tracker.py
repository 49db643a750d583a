"""The estimator in a kinematic closed loop: arcs, breathing, jump, consistency."""

import numpy as np
import pytest

from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.wrist_law import WristParams
from tests.systems.passive_wrist.wrist_loop import Case, Wall, arcs, run

GUESS = [0.012, 0.0, 0.020]


def case(wall: Wall | None = None, mode: str = "pwe", **options) -> Case:
    return Case(
        wall=wall or Wall(),
        fulcrum=FulcrumParams(guess=GUESS),
        wrist=WristParams(mode=mode, guess=GUESS),
        **options,
    )


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def settled(out, start: float, bound: float = 1e-3) -> float:
    late = np.flatnonzero((out["error"] > bound) & (out["t"] >= start))
    return 0.0 if not len(late) else float(out["t"][late[-1]] - start)


@pytest.mark.parametrize("stiffness", [100.0, 500.0, 3000.0])
def test_still_wall_is_found_at_once(stiffness):
    out = run(case(Wall(stiffness=stiffness), tip=arcs(5.0), duration=10.0))
    assert settled(out, 5.0) < 2.0
    assert rms(out["force"][out["t"] > 5.0]) < 0.1
    assert out["K"][-1] == pytest.approx(stiffness, rel=0.35)


def test_breathing_is_understood_after_a_breath():
    wall = Wall(amplitude=[0.005, 0.0, 0.008], rate=0.2, phase=0.3)
    out = run(case(wall, tip=arcs(5.0), duration=20.0))
    late = out["t"] > 6.0
    assert out["rate"][late] == pytest.approx(0.2, rel=0.03)
    assert settled(out, 5.0) < 10.0
    assert np.interp(8.0, out["t"], out["error"]) < 2e-3
    assert rms(out["force"][late]) < 0.05
    assert np.mean(out["nees"][out["t"] > 15.0] > 7.81) < 0.1


def test_a_held_shaft_keeps_its_depth_honest():
    """Depth cannot be seen at zero force: it must not run away from its sigma."""
    wall = Wall(amplitude=[0.005, 0.0, 0.0], rate=0.2)
    out = run(case(wall, duration=25.0))
    late = out["t"] > 8.0
    assert np.all(np.abs(out["depth"][late]) < 3.0 * out["along"][late])


def test_a_jump_is_followed_once_and_leaves_stiffness_alone():
    out = run(case(Wall(step=[0.018, 0.0, 0.0], step_at=8.0), duration=11.0))
    after = out["t"] >= 8.0
    force, t = out["force"][after], out["t"][after] - 8.0
    assert t[force > 2.0][-1] < 0.25
    assert t[force > 0.2][-1] < 0.45
    assert out["jumps"][-1] == 1.0
    assert out["K"][-1] == pytest.approx(500.0, rel=0.15)


def test_spring_law_and_first_guess_are_worse():
    wall = Wall(amplitude=[0.005, 0.0, 0.008], wave="ventilator")
    got = {
        mode: run(case(wall, mode, tip=arcs(5.0), duration=22.0))
        for mode in ("pwe", "spring", "off")
    }
    level = {m: rms(o["force"][o["t"] > 15.0]) for m, o in got.items()}
    assert level["spring"] > 2.0 * level["pwe"]
    assert level["off"] > 20.0 * level["pwe"]


def test_an_estimate_outside_the_neighbourhood_is_refused():
    far = case(Wall(step=[0.09, 0.0, 0.0], step_at=4.0, stiffness=300.0), duration=6.0)
    out = run(far)
    assert out["refused"][-1] >= 1.0
    assert np.isfinite(out["force"]).all()


@pytest.mark.study
def test_consistency_over_random_walls():
    rng = np.random.default_rng(5)
    shares = []
    for seed in range(16):
        a = rng.uniform(0.0, 0.006)
        wall = Wall(
            amplitude=[a, 0.3 * a, 1.5 * a],
            rate=rng.uniform(0.15, 0.35),
            wave=("sine", "ventilator")[seed % 2],
            phase=rng.uniform(),
            stiffness=float(np.exp(rng.uniform(np.log(150), np.log(2500)))),
        )
        out = run(case(wall, tip=arcs(0.0, period=7.0), duration=25.0, seed=seed))
        shares.append(np.mean(out["nees"][out["t"] > 15.0] > 7.81))
    assert np.mean(shares) < 0.1
