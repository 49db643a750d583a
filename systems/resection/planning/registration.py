"""Where tissue has moved to: a smooth displacement fitted to surfaces that were seen.

Points s of a surface, displaced back, should lie on it: (s - w d(s) - v) n = 0, v its
nearest point and n the normal there. d is a quadratic polynomial of the place, held by
what was known of it before, as in a Kalman filter; few points that lie elsewhere count
little (Huber).

The border of the tumour moves by all of d, w = 1. So does a cavity that was cut before.
But a surface that is cut just now lies where it was cut, however far the tissue had
moved: taking it to move in step with the volume that goes, a surface cut when a share w
of that was still to go has moved by w d. A scan of fresh cuts alone says little.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from plants.tissue.surface import surface

Array = NDArray[np.float64]

PRIOR = np.array([0.5, *[0.25] * 3, *[0.12] * 6])
"""Rms of the terms of degree 0, 1 and 2 at the tumour's border, over what is feared."""

ROUNDS = 15
HUBER = 2.0
SMOOTH = 0.9
"""Of the surface, in voxels, as scans of surfaces are."""


def terms(u: Array) -> Array:
    """Terms of a quadratic polynomial, (n, 3) to (n, 10)."""
    x, y, z = u.T
    told: Array = np.stack(
        [np.ones(len(u)), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x], axis=1
    )
    return told


def border(
    cavity: NDArray[np.bool_], origin: Array, spacing: float
) -> tuple[Array, Array]:
    """Points of a cavity's surface and their normals, (n, 3) each."""
    vertices, _ = surface(cavity, origin, spacing)
    field = ndimage.gaussian_filter(cavity.astype(float), SMOOTH)
    index = ((vertices - origin) / spacing).T
    normals = np.stack(
        [
            ndimage.map_coordinates(slope, index, order=1, mode="nearest")
            for slope in np.gradient(field)
        ],
        axis=1,
    )
    return vertices, normals / np.maximum(
        np.linalg.norm(normals, axis=1, keepdims=True), 1e-12
    )


@dataclass
class Surface:
    """A surface that was seen.

    Attributes:
        points: Seen on it, (n, 3) in m.
        inside: What it surrounds, if nothing had moved, (nx, ny, nz).
        since: By how much of the displacement it has moved, near each voxel, (nx, ny,
            nz).
        noise: Of a point, in m.
        alike: Points that share one error, as neighbours in an image do.
    """

    points: Array
    inside: NDArray[np.bool_]
    since: Array
    noise: float
    alike: float = 1.0


@dataclass
class Fit:
    """A displacement as far as it is known.

    Attributes:
        theta: Factors of the terms, (10, 3) in m.
        spread: Their covariance, (30, 30) in m2.
    """

    theta: Array = field(default_factory=lambda: np.zeros((10, 3)))
    spread: Array = field(default_factory=lambda: np.zeros((30, 30)))

    def later(self, feared: float) -> "Fit":
        """After the tissue may have moved by so much, in m."""
        more = np.repeat((feared * PRIOR) ** 2, 3)
        return Fit(self.theta, self.spread + np.diag(more))

    def scaled(self, factor: float) -> "Fit":
        """So many times of it."""
        return Fit(factor * self.theta, factor**2 * self.spread)

    def displacement(self, middle: Array, length: float) -> Callable[[Array], Array]:
        """In m, of places (..., 3), about the tumour's middle and half its length."""

        def told(place: Array) -> Array:
            flat = np.asarray(place, float).reshape(-1, 3)
            d: Array = (terms((flat - middle) / length) @ self.theta).reshape(
                place.shape
            )
            return d

        return told


def registered(
    surfaces: Sequence[Surface],
    origin: Array,
    spacing: float,
    middle: Array,
    length: float,
    before: Fit,
) -> tuple[Fit, float]:
    """The displacement that surfaces show.

    Args:
        surfaces: What was seen.
        origin: Centre of voxel (0, 0, 0), in m.
        spacing: Edge of a voxel in m.
        middle: Of the tumour, (3,) in m.
        length: Half the tumour's, in m.
        before: What is known without them.

    Returns:
        What is known with them, and the rms distance in m of the points from where
        they should be.
    """
    points = np.concatenate([seen.points for seen in surfaces])
    counts = [len(seen.points) for seen in surfaces]
    sigma = np.repeat([np.hypot(s.noise, 0.3 * spacing) for s in surfaces], counts)
    parts = np.split(np.arange(len(points)), np.cumsum(counts)[:-1])
    borders = [border(seen.inside, origin, spacing) for seen in surfaces]
    alike = np.repeat([seen.alike for seen in surfaces], counts)
    trees = [cKDTree(vertices) for vertices, _ in borders]
    index = np.rint((points - origin) / spacing).astype(int).T
    w = np.empty(len(points))
    for seen, part in zip(surfaces, parts, strict=True):
        _, at = ndimage.distance_transform_edt(~seen.inside, return_indices=True)
        size = np.array(seen.inside.shape)[:, None]
        w[part] = seen.since[tuple(at[:, *np.clip(index[:, part], 0, size - 1)])]
    basis = w[:, None] * terms((points - middle) / length)
    theta, prior = before.theta, np.linalg.inv(before.spread)

    def apart() -> tuple[Array, Array]:
        """From the surfaces' planes, and their normals, at points displaced back."""
        back, n, r = points - basis @ theta, np.empty(points.shape), np.empty(len(w))
        for part, tree, (vertices, normals) in zip(parts, trees, borders, strict=True):
            _, nearest = tree.query(back[part])
            n[part] = normals[nearest]
            r[part] = ((back[part] - vertices[nearest]) * n[part]).sum(axis=1)
        return r, n

    H = prior
    for _ in range(ROUNDS):
        r, n = apart()
        weight = 1.0 / np.maximum(np.abs(r) / (HUBER * sigma), 1.0) / sigma**2 / alike
        J = -(basis[:, :, None] * n[:, None, :]).reshape(len(points), 30)
        H = (J * weight[:, None]).T @ J + prior
        g = (J * weight[:, None]).T @ r + prior @ (theta - before.theta).reshape(-1)
        theta = theta - np.linalg.solve(H, g).reshape(10, 3)
    rest, _ = apart()
    return Fit(theta, np.linalg.inv(H)), float(np.sqrt(np.mean(rest**2)))
