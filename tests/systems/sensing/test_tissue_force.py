"""The tissue's force told from the wall's."""

import numpy as np
import pytest

from systems.common.compiled import packed
from systems.common.geometry import cross, sub
from systems.sensing.tissue_force import TissueForceParams, moment_about
from systems.sensing.touch_filter import K, doubt, pressing, prior, weigh

P_S, P_I, P_P = (0.0, 0.05, 0.25), (0.001, -0.002, 0.0), (0.02, 0.02, -0.09)
N = (0.5, 0.1, 0.86)


@pytest.mark.parametrize("wall", [(0.0, 0.0, 0.0), (1.5, -0.8, 0.0), (0.1, 0.1, 0.5)])
def test_wall_and_friction_do_not_count(wall):
    n = np.array(N) / np.linalg.norm(N)
    arms = np.subtract(P_P, P_S), np.subtract(P_I, P_S)
    moment = np.cross(arms[0], 0.5 * n) + np.cross(arms[1], wall)
    m_I = moment_about(P_I, tuple(moment), tuple(0.5 * n + wall), P_S)
    assert m_I == pytest.approx(0.5 * np.cross(np.subtract(P_P, P_I), n))


def touched(k: float, lower: float, seed: int) -> tuple[float, float, float]:
    """Error of F in N after a touch of 1 s, how sure the filter is, and F before.

    The tip is in the air for 1.5 s and then goes 1 mm deep, in 0.5 s.
    """
    params = TissueForceParams()
    record, belief = packed(params)[0], prior(params, 0.4)
    rng, arm, reach = np.random.default_rng(seed), cross(sub(P_P, P_I), N), 0.3
    step = np.sqrt(params.period)
    drift = step * np.hypot(params.moment_drift, reach * params.force_drift)
    noise = np.hypot(params.moment_noise, reach * params.force_noise)
    bias = rng.normal(0.0, params.moment_bias, 3)
    before = force = depth = 0.0
    for i in range(360):
        depth = min(1e-3, 2e-3 * (params.period * i - 1.5))
        force = max(0.0, k * (depth - lower))
        bias += rng.normal(0.0, drift, 3)
        m = bias + force * np.array(arm) + rng.normal(0.0, noise, 3)
        belief = weigh(record, belief, tuple(m.tolist()), reach, arm, depth)
        if i == 120:
            before = pressing(belief, depth)
    return pressing(belief, depth) - force, doubt(belief, depth), before


def test_it_is_as_sure_as_it_says_of_a_stiffness_and_a_surface_it_does_not_know():
    tissues = [(350.0, 2e-4), (500.0, 0.0), (800.0, -2e-4), (500.0, 3e-4)]
    rows = np.array([touched(k, h, seed) for seed in range(8) for k, h in tissues])
    error, sigma, before = rows.T
    assert (before == 0.0).all()
    assert sigma.max() < 0.06
    # 99 % of means of 32 squares lie within.
    assert 0.45 < np.mean((error / sigma) ** 2) < 1.8


def test_what_has_no_lever_is_not_taken_for_a_force():
    params = TissueForceParams()
    belief = prior(params, 0.4)
    there = weigh(
        packed(params)[0], belief, (1e-2, 0.0, 0.0), 0.3, (0.0, 0.0, 0.0), 1e-3
    )
    assert there[0, K] == belief[0, K]
    assert there[0, 0] > 0.0
