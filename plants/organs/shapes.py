"""Synthetic organs: smooth closed tubes about a bent line, their bumps from a seed.

Shapes and sizes are those of anatomy in the large (a liver of two lobes, 200 mm wide;
a stomach that is a J; a gallbladder like a pear; a length of bowel with its bumps), and
of no patient. In the organ's frame its length is along x.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from plants.organs.surface import Surface

type Array = NDArray[np.float64]
type Line = tuple[Array, Array, Array]
"""Middle (n, 3), and half axes across it, level and upright (n), m."""

DETAIL = 64
"""Rings half around and points around: 2 x 64 x 80 triangles."""


def _bell(t: Array, middle: float, width: float) -> Array:
    return np.exp(-(((t - middle) / width) ** 2))


def _liver(t: Array) -> Line:
    """Two lobes with a notch: the right one thick, the left one flat."""
    right, left = _bell(t, -0.4, 0.55), _bell(t, 0.58, 0.36)
    middle = np.stack([0.1 * t, 0.012 * t, 0.010 * left - 0.006 * t**2], axis=1)
    return (
        middle,
        0.018 + 0.052 * right + 0.03 * left,
        0.008 + 0.034 * right + (0.014 * left),
    )


def _gallbladder(t: Array) -> Line:
    wide = 0.006 + 0.009 * _bell(t, -0.35, 0.6)
    middle = np.stack([0.038 * t, 0.006 * t**2, 0.004 * t], axis=1)
    return middle, wide, wide


def _stomach(t: Array) -> Line:
    """A J, wide at its fundus."""
    bend = 1.15 * (t + 0.1)
    middle = np.stack(
        [0.075 * np.sin(bend), 0.075 * (1.0 - np.cos(bend)), 0.01 * t], axis=1
    )
    wide = 0.016 + 0.022 * _bell(t, -0.5, 0.6)
    return middle, wide, 0.85 * wide


def _bowel(t: Array) -> Line:
    """A length of colon with its haustra."""
    middle = np.stack([0.11 * t, 0.022 * np.sin(3.0 * t), 0.006 * np.cos(4 * t)], 1)
    wide = 0.017 + 0.003 * np.cos(26.0 * t)
    return middle, wide, wide


SHAPES: dict[str, Callable[[Array], Line]] = {
    "liver": _liver,
    "gallbladder": _gallbladder,
    "stomach": _stomach,
    "bowel": _bowel,
}


def shape(kind: str, seed: int = 0, detail: int = DETAIL) -> Surface:
    """A synthetic organ in its own frame, m.

    Args:
        kind: One of `SHAPES`.
        seed: Of its bumps.
        detail: Its triangles go with the square of it.
    """
    rings, around = 2 * detail, round(1.25 * detail)
    t = -np.cos(np.pi * np.arange(1, rings) / rings)  # closer towards the ends
    middle, level, upright = SHAPES[kind](t)
    # Round ends: half axes fall as a circle's within their own size of the end.
    length = np.linalg.norm(np.diff(middle, axis=0), axis=1)
    run = np.concatenate([[0.0], np.cumsum(length)])
    left = np.minimum(run - run[0], run[-1] - run) / (0.6 * np.maximum(level, upright))
    round_off = np.sqrt(1.0 - (1.0 - np.minimum(left + 1e-3, 1.0)) ** 2)
    phi = 2.0 * np.pi * np.arange(around) / around
    rng = np.random.default_rng(seed)
    bumps = np.ones((len(t), around))
    for _ in range(10):
        m, n = rng.integers(1, 5), rng.uniform(-6.0, 6.0)
        size = 0.02 * rng.standard_normal()
        bumps += size * np.cos(m * phi + n * t[:, None] + rng.uniform(0.0, 2 * np.pi))
    # The rings stand across the line, level and upright, without a twist.
    tangent = np.gradient(middle, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    side = np.cross([0.0, 0.0, 1.0], tangent)
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(tangent, side)
    wide, high = (round_off * level)[:, None], (round_off * upright)[:, None]
    rim = middle[:, None] + side[:, None] * (wide * bumps * np.cos(phi))[..., None]
    rim += up[:, None] * (high * bumps * np.sin(phi))[..., None]
    ends = rim[[0, -1]].mean(axis=1)
    points = np.concatenate([ends[:1], rim.reshape(-1, 3), ends[1:]])
    return Surface(points, _closed(len(t), around))


def _closed(rings: int, around: int) -> NDArray[np.int64]:
    """Triangles of rings of points with a point at each end."""
    k = np.arange(around)
    after = (k + 1) % around
    first, last = 1 + k, 1 + (rings - 1) * around + k
    found = [np.stack([0 * k, 1 + after, first], axis=1)]
    for i in range(rings - 1):
        a, b = 1 + i * around + k, 1 + i * around + after
        found.append(np.stack([a, b, b + around], axis=1))
        found.append(np.stack([a, b + around, a + around], axis=1))
    end = np.full(around, 1 + rings * around)
    found.append(np.stack([last, 1 + (rings - 1) * around + after, end], axis=1))
    return np.concatenate(found)
