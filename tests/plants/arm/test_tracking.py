"""The arm carries the instrument's tip where the set-points say."""

import math

import numpy as np
import pytest

from plants.abdomen.abdomen import AbdomenParams

PERIOD = 1.0 / 120.0


def weave(time):
    """A tip path of 0.1 m/s at most, in all directions, from a standstill."""
    grow = min(time, 1.0)
    grow *= grow * (3.0 - 2.0 * grow)
    return np.array(
        [
            0.040 * grow * math.sin(1.9 * time),
            0.025 * grow * math.sin(1.9 * time + 0.5),
            -0.12 + 0.025 * grow * math.sin(2.5 * time),
        ]
    )


def peak_speed(duration):
    times = np.arange(0.0, duration, 1e-3)
    path = np.array([weave(t) for t in times])
    return np.linalg.norm(np.diff(path, axis=0), axis=1).max() / 1e-3


@pytest.mark.parametrize(
    "abdomen",
    [
        AbdomenParams(),
        AbdomenParams(stiffness=100.0, seal_friction=3.0),
        AbdomenParams(stiffness=3000.0),
        AbdomenParams(stiffness=3000.0, seal_friction=0.0),
    ],
)
def test_tip_is_within_a_fifth_of_a_millimetre_at_0_1_m_s(make_scene, abdomen):
    duration = 3.0
    scene = make_scene(
        p_WP_of_time=weave, duration=duration + 0.1, abdomen_params=abdomen
    )
    assert 0.09 < peak_speed(duration) < 0.11
    worst_tip = worst_force = 0.0
    for k in range(1, round(duration / PERIOD)):
        time = k * PERIOD
        scene.simulator.AdvanceTo(time)
        p_WP = scene.instrument.tip.CalcPoseInWorld(scene.context).translation()
        worst_tip = max(worst_tip, np.linalg.norm(p_WP - weave(time)))
        force = scene.output(scene.wall_force, "force")
        worst_force = max(worst_force, np.linalg.norm(force))
    assert worst_tip < 0.2e-3
    # The shaft pivots about the fulcrum all the while.
    assert worst_force < abdomen.stiffness * 0.12e-3 + 0.08
    steps = scene.simulator.get_num_steps_taken()
    assert steps < 1.3 * duration / PERIOD  # one step from instant to instant


def test_held_tip_does_not_droop_under_the_instruments_weight(make_scene):
    scene = make_scene(p_WP=(0.03, 0.02, -0.10))
    scene.simulator.AdvanceTo(1.0)
    p_WP = scene.instrument.tip.CalcPoseInWorld(scene.context).translation()
    np.testing.assert_allclose(p_WP, [0.03, 0.02, -0.10], atol=0.02e-3)
