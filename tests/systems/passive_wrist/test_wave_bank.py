"""The bank of waves against a design matrix written out, and on walls that breathe."""

import numpy as np
import pytest

from plants.abdomen.wall_motion import wave
from systems.passive_wrist import wave_bank
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_kernels import RECORD_PERIOD, Entry
from systems.passive_wrist.wave_bank import HARMONICS, RATES, fit_waves

GUESS = [0.006, 0.0, 0.008]
PARAMS = FulcrumParams(guess=GUESS)


def record(rate, shape="sine", turn=0.4, entries=100, size=1.0):
    """Entries of a shaft that turns by `turn` rad under a wall that breathes."""
    rng, stiffness, phase = np.random.default_rng(1), 500.0, 0.3
    amplitude = size * np.array([5e-3, 0.0, 8e-3])
    t = RECORD_PERIOD * (np.arange(entries) + 0.5)
    now = RECORD_PERIOD * entries
    wall = np.outer([wave(shape, rate * s + phase) for s in t], amplitude)
    angle = turn * np.sin(2.0 * np.pi * t / 17.0)
    u = np.stack([np.sin(angle), 0.2 * angle, -np.cos(angle)], axis=1)
    u /= np.linalg.norm(u, axis=1)[:, None]
    # The shaft passes up to half a millimetre beside the fulcrum.
    off = 5e-4 * np.stack([np.cos(t), np.sin(1.7 * t), 0.0 * t], axis=1)
    p = wall - 0.22 * u + off
    r = wall - p
    f = stiffness * (r - (r * u).sum(axis=1)[:, None] * u)
    f += rng.normal(0.0, 0.05 / np.sqrt(12.0), f.shape)
    m = 0.22 * np.cross(u, f)
    at_now = wave(shape, rate * now + phase) * amplitude
    return Entry(p, u, f, m, np.ones(entries)), at_now


def design(seen, rate):
    """Rows of the module's equation for every entry and axis, written out."""
    t = -RECORD_PERIOD * (np.arange(len(seen.u))[::-1] + 0.5)
    rows, right = [], []
    for i, tau in enumerate(t):
        u = seen.u[i] / np.linalg.norm(seen.u[i])
        P = np.eye(3) - np.outer(u, u)
        phases = 2.0 * np.pi * rate * tau * np.arange(1, HARMONICS + 1)
        basis = [1.0]
        for a in phases:
            basis += [np.cos(a), -np.sin(a)]
        rows.append(np.hstack([np.kron(basis, P), -(P @ seen.f[i])[:, None] / 500.0]))
        right.append(P @ (seen.p[i] - GUESS))
    return np.vstack(rows), np.concatenate(right)


def normal(sums, rate):
    """Information and right side at one rate."""
    (N,), (n,) = sums.normal(wave_bank._waves(np.array([rate]), 40))
    return sums.weighed(N, n, sums.noise)


@pytest.mark.parametrize("rate", [0.2, 0.31])
def test_the_sums_are_the_normal_equations_of_the_design_matrix(rate):
    seen, _ = record(rate, entries=40)
    # Force and moment say the same: what is fused is the force.
    origin = np.array(GUESS)
    depth = ((origin - seen.p) * seen.u).sum(axis=1)
    seen = seen._replace(m=depth[:, None] * np.cross(seen.u, seen.f))
    sums = wave_bank._Sums(PARAMS, seen, 500.0, 0.1)
    L, b = normal(sums, rate)
    A, y = design(seen, rate)
    information = A.T @ A / sums.noise**2 + sums.prior
    np.testing.assert_allclose(L, information, rtol=1e-9, atol=1e-6)
    mean = np.zeros(len(b))
    mean[-1] = 1.0
    np.testing.assert_allclose(
        b, A.T @ y / sums.noise**2 + sums.prior @ mean, rtol=1e-9, atol=1e-6
    )
    # The evidence is the density of y, but for what no rate changes.
    (value,) = sums.evidence(L[None], b[None])
    C = A @ np.linalg.inv(sums.prior) @ A.T + sums.noise**2 * np.eye(len(y))
    e = y - A @ mean
    density = -0.5 * e @ np.linalg.solve(C, e) - 0.5 * np.linalg.slogdet(C)[1]
    L2, b2 = normal(sums, 0.27)
    A2, _ = design(seen, 0.27)
    C2 = A2 @ np.linalg.inv(sums.prior) @ A2.T + sums.noise**2 * np.eye(len(y))
    e2 = y - A2 @ mean
    density2 = -0.5 * e2 @ np.linalg.solve(C2, e2) - 0.5 * np.linalg.slogdet(C2)[1]
    (value2,) = sums.evidence(L2[None], b2[None])
    assert value - value2 == pytest.approx(density - density2, rel=1e-6)


@pytest.mark.parametrize("shape", ["sine", "ventilator"])
@pytest.mark.parametrize("rate", [0.19, 0.26, 0.37])
def test_rate_and_depth_of_a_turning_shaft(rate, shape):
    seen, at_now = record(rate, shape)
    fit = fit_waves(PARAMS, seen, 500.0, 0.1)
    assert fit.rate == pytest.approx(rate, rel=0.02) and fit.share > 0.9
    u = seen.u[-1]
    now = fit.x[:3] + sum(fit.x[i : i + 3] for i in range(3, len(fit.x) - 1, 6))
    error = u @ (now - at_now)
    assert abs(error) < 1e-3 and abs(error) < 4.0 * fit.along(u)
    near = fit_waves(PARAMS, seen, 500.0, 0.1, known=rate)
    assert near.rate == pytest.approx(fit.rate, rel=2e-3)


def test_a_shaft_that_has_not_turned_tells_no_depth():
    seen, _ = record(0.25, turn=0.0)
    fit = fit_waves(PARAMS, seen, 500.0, 0.1)
    assert fit.along(seen.u[-1]) > 0.01


def test_a_still_wall_has_no_rate():
    seen, _ = record(0.25, size=0.0)
    fit = fit_waves(PARAMS, seen, 500.0, 0.1)
    assert fit is None or fit.share < 0.85
    assert RATES[0] == pytest.approx(0.12) and RATES[-1] == pytest.approx(0.5)
