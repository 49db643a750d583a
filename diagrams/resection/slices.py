"""Three orthogonal slices through a point: the patient's image, and what is planned.

As radiologists look at them: axial and coronal with the patient's left on the right,
sagittal from the left side with the face to the left.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.tissue.image import Image
from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL, NAMES, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.volume import Volume

type Vector = NDArray[np.float64]

SLICES = {
    "axial": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "coronal": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "sagittal": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Of each what in P (LPS) goes to the right and what goes down."""

EDGES = {"axial": "RLAP", "coronal": "RLHF", "sagittal": "APHF"}
"""Where the patient is at the left, right, upper and lower edge."""

SIZE = 240
"""Pixels along an edge."""

AROUND = 0.01
"""Shown around the plan's grid, in m."""

GROUND, TISSUE, VESSEL, FREE = 40, (237, 184, 107), (191, 26, 31), (115, 168, 230)
GOOD, BAD = (38, 158, 76), (204, 56, 46)
COLORS = np.array([(GROUND,) * 3, TISSUE, VESSEL, FREE, GOOD, BAD])

SEEN_AS = np.zeros((len(NAMES), 2), np.int8)
"""Which of COLORS, of each label, where it is gone and where it is not."""
SEEN_AS[[TUMOUR, CAP, CHANNEL], 0] = 3
SEEN_AS[[TUMOUR, CAP], 1] = 1
SEEN_AS[CRITICAL] = 2

SHARES = np.array([(0.0, 0.85, 0.85, 0.85, 0.6, 0.6), (0.0, 0.3, 0.3, 0.3, 0.5, 0.5)])
"""Of each of COLORS over grey; fainter over a patient's image."""


class Slices:
    """Slices of a volume in the patient's frame P, and of his image if there is one."""

    def __init__(self, volume: Volume, image: Image | None = None) -> None:
        """Finds what there is to be shown: the box of the volume's grid in P."""
        self.volume, self.image = volume, image
        size = np.array(volume.labels.shape)
        corners = np.array(np.meshgrid(*([0, n - 1] for n in size))).reshape(3, -1).T
        corners = volume.origin + volume.spacing * corners
        corners = corners @ volume.X_PW[:3, :3].T + volume.X_PW[:3, 3]
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.middle = (low + high) / 2
        self.pixel = (float((high - low).max()) + 2 * AROUND) / SIZE

    def in_patient(self, p_W: Vector) -> Vector:
        """A point in P."""
        return self.volume.X_PW[:3, :3] @ p_W + self.volume.X_PW[:3, 3]

    def pixel_of(self, name: str, p_W: Vector) -> tuple[float, float]:
        """Where a point is seen in a slice: pixels from the left and from the top."""
        right, down = map(np.array, SLICES[name])
        away = (self.in_patient(p_W) - self.middle) / self.pixel + SIZE / 2 - 0.5
        signs = np.array([right.sum(), down.sum()])
        half = SIZE / 2 - 0.5
        i, j = (float(abs(axis) @ away) for axis in (right, down))
        return (i - half) * signs[0] + half, (j - half) * signs[1] + half

    def depth_of(self, name: str, p_W: Vector, through_W: Vector) -> float:
        """How far in m a point lies off the slice through another."""
        right, down = map(np.array, SLICES[name])
        away = self.in_patient(p_W) - self.in_patient(through_W)
        return abs(float(np.cross(right, down) @ away))

    def point(self, name: str, pixel: tuple[float, float], p_W: Vector) -> Vector:
        """The point in W of a pixel, in the slice through another point in W."""
        right, down = map(np.array, SLICES[name])
        p_P, half = self.in_patient(p_W), SIZE / 2 - 0.5
        for axis, n in zip((right, down), pixel, strict=True):
            wanted = axis @ self.middle + (n - half) * self.pixel
            p_P = p_P + (wanted - axis @ p_P) * axis
        X_WP: Vector = np.linalg.inv(self.volume.X_PW)
        return X_WP[:3, :3] @ p_P + X_WP[:3, 3]

    def picture(
        self, name: str, p_W: Vector, shape: NDArray[np.bool_], is_good: bool
    ) -> NDArray[np.uint8]:
        """A slice, (SIZE, SIZE, 3).

        Args:
            name: Of SLICES.
            p_W: The point it goes through.
            shape: What a proposal frees, or would have to, (nx, ny, nz).
            is_good: Whether it is feasible.
        """
        volume, n = self.volume, np.arange(SIZE)
        corner = self.point(name, (0.0, 0.0), p_W)
        right = self.point(name, (1.0, 0.0), p_W) - corner
        down = self.point(name, (0.0, 1.0), p_W) - corner
        p = corner + n[:, None, None] * down + n[None, :, None] * right
        index = np.rint((p - volume.origin) / volume.spacing).astype(int)
        inside = ((index >= 0) & (index < volume.labels.shape)).all(axis=-1)
        _, ny, nz = volume.labels.shape
        at = np.where(
            inside, (index[..., 0] * ny + index[..., 1]) * nz + index[..., 2], 0
        )
        label = np.where(inside, volume.labels.take(at), BRAIN)
        seen = SEEN_AS[label, (volume.tau.take(at) == SOLID).astype(int)]
        wanted = np.where(inside & shape.take(at), 4 if is_good else 5, 0)
        picture = np.repeat(self._greys(p)[..., None], 3, axis=-1)
        for layer in (seen, wanted):
            share = SHARES[int(self.image is not None)][layer]
            for axis in (0, 1):  # borders stand out
                share[(layer != np.roll(layer, 1, axis)) & (layer > 0)] = 1.0
            picture += share[..., None] * (COLORS[layer] - picture)
        return np.rint(picture).astype(np.uint8)

    def _greys(self, p_W: Vector) -> Vector:
        """The image's greys at points in W (..., 3)."""
        if self.image is None:
            return np.full(p_W.shape[:-1], float(GROUND))
        X_VW = np.linalg.inv(self.image.X_PV) @ self.volume.X_PW
        index = p_W @ X_VW[:3, :3].T + X_VW[:3, 3]
        return ndimage.map_coordinates(
            self.image.values, np.moveaxis(index, -1, 0), float, order=1
        )
