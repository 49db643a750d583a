"""A displacement fitted to surfaces: found again, in part by fresh cuts."""

import numpy as np
import pytest

from systems.resection.planning.registration import Fit, Surface, registered, terms

SIZE, SPACING = (40, 40, 40), 1e-3
ORIGIN, RADIUS = np.full(3, -0.0195), 0.012


def fitted(w: float, noise: float = 0.0) -> tuple[float, float]:
    """Largest error of a fit in a ball, and how far it moved, in m.

    Args:
        w: Share of the displacement by which the surface had moved.
        noise: Of points, in m.
    """
    rng = np.random.default_rng(5)
    axis = [ORIGIN[r] + SPACING * np.arange(SIZE[r]) for r in range(3)]
    x, y, z = np.meshgrid(*axis, indexing="ij")
    ball = (x / 1.0) ** 2 + (y / 0.8) ** 2 + (z / 1.2) ** 2 <= RADIUS**2
    theta = 1e-3 * rng.normal(size=(10, 3)) * np.array([0.6, *[0.3] * 9])[:, None]

    def moved(p):
        return terms(p / RADIUS) @ theta

    n = rng.normal(size=(1500, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    on = n * RADIUS / np.linalg.norm(n / [1.0, 0.8, 1.2], axis=1, keepdims=True)
    points = on.copy()
    for _ in range(5):
        points = on + w * moved(points)
    points += noise * rng.normal(size=points.shape)
    since = np.full(SIZE, w)
    seen = Surface(points, ball, since, max(noise, 1e-4))
    middle, before = np.zeros(3), Fit().later(3e-3)
    fit, rms = registered([seen], ORIGIN, SPACING, middle, RADIUS, before)
    assert rms < 0.3e-3 + noise
    found = fit.displacement(middle, RADIUS)
    error = np.linalg.norm(found(on) - moved(on), axis=1)
    return float(np.median(error)), float(np.linalg.norm(moved(on), axis=1).max())


def test_a_displacement_is_found_again():
    error, most = fitted(1.0)
    assert most > 1e-3 and error < 0.3 * most
    assert fitted(1.0, noise=0.2e-3)[0] < 0.35 * most


def test_fresh_cuts_say_nothing():
    error, most = fitted(0.0)
    assert error > 0.2 * most  # nothing but the prior is left
    with pytest.raises(ValueError):
        registered([], ORIGIN, SPACING, np.zeros(3), RADIUS, Fit().later(3e-3))
