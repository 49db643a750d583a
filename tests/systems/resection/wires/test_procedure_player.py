"""Plans played: every posture at an instant, no rate that jumps, little time lost."""

import numpy as np
import pytest

from systems.resection.wires.procedure_player import (
    ProcedurePlayerParams,
    played,
    profile,
)

PARAMS = ProcedurePlayerParams()
RATES = np.array([PARAMS.travel_rate] + [PARAMS.bend_rate] * 6)


def wander(seed, n=60):
    """Postures of a random plan: short and long ways, onwards and back."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(n, 7)) * RATES * rng.lognormal(-2.5, 1.0, (n, 1))
    steps[1::7] = -steps[0::7][: len(steps[1::7])]  # straight back
    steps[2::9] = 0.8 * steps[1::9][: len(steps[2::9])]  # straight on
    return np.cumsum(steps, axis=0)


@pytest.mark.parametrize("seed", range(6))
def test_no_rate_is_too_large_nor_jumps_and_no_corner_is_cut(seed):
    x = wander(seed)
    waits = np.zeros(len(x))
    waits[20] = 0.5
    plan = profile(x, PARAMS, waits)
    for row, time, wait in zip(x, plan.times, plan.waits, strict=True):
        assert np.allclose(played(x, plan, PARAMS, time), row, atol=1e-12)
        assert np.allclose(played(x, plan, PARAMS, time + wait), row, atol=1e-12)
    periods = plan.times / PARAMS.lead
    assert np.allclose(periods, np.round(periods), atol=1e-6)
    instants = np.arange(0.0, plan.times[-1] + 1.0, PARAMS.lead)
    y = np.array([played(x, plan, PARAMS, time) for time in instants])
    rate = np.diff(y, axis=0) / PARAMS.lead
    assert (np.abs(rate) <= RATES * (1 + 1e-6)).all()
    change = np.abs(np.diff(rate, axis=0)) / PARAMS.lead
    assert (change <= RATES / PARAMS.turn * (1 + 1e-6)).all()


def test_a_long_way_takes_hardly_longer_than_at_full_speed():
    """A corner costs its own ramps: the ways beside it are not slowed down."""
    ways = np.array([0.5, -0.5] * 10)[:, None] * np.array([0.0, 1, 0, 0, 0, 0, 0])
    x = np.vstack([np.zeros(7), np.cumsum(ways, axis=0)])
    plan = profile(x, PARAMS)
    full = 20 * 0.5 / PARAMS.bend_rate
    lost = (plan.times[-1] - plan.times[0] - full) / 20
    assert lost <= PARAMS.turn + 2 * PARAMS.lead
