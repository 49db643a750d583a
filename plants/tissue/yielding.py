"""Tissue that yields: as the tumour goes, what surrounds the cavity moves.

Quasi-static: the displacement of each place is a smooth field, drawn from a seed, times
the share of the tumour that is gone. What has been removed is kept as the tissue was
at first (*material*): a place p shows the material at p - d(p). The channel holds.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.snake.parameters import SnakeParams
from plants.tissue.execution import Execution
from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from plants.tissue.tissue import signed_distance
from plants.tissue.tissue_carver import Carving
from plants.tissue.volume import Volume
from systems.common.parameter import check, parameter

Array = NDArray[np.float64]
type Field = Callable[[Array], Array]
"""Displacement in m of places in W, (..., 3) to (..., 3)."""

WAVES = 4
BLUR = 2.0
"""Of an image's noise, in voxels."""

LENGTHS = (1.5, 3.0)
"""Of the field's waves, in lengths of the tumour."""

CLEAR = 2.5
"""Voxels about the channel in which a scan tells nothing."""

STEP = 0.1e-3
"""Of the displacement, in m, at which the tissue is set anew."""


@dataclass
class TissueShiftParams:
    """How tissue yields."""

    most: float = parameter(
        0.0, "of the tumour's displacement when all of it is gone", "m",
        least=0.0, most=0.005,
    )  # fmt: skip
    seed: int = parameter(1, "of the displacement's field", least=0, most=2**63 - 1)


@dataclass
class CavityScanParams:
    """What is measured between rounds."""

    on: bool = parameter(True, "whether anything is")
    image: bool = parameter(
        True, "whether an image shows what is left; else a scan the surface"
    )
    image_noise: float = parameter(
        0.3e-3,
        "of borders in the image, rms, alike over some voxels",
        "m",
        least=0.0,
        most=5e-3,
    )
    noise: float = parameter(
        0.2e-3, "of a point of the surface, rms", "m", least=0.0, most=2e-3
    )
    missing: float = parameter(
        0.3, "share of the surface that a scan does not see", least=0.0, most=0.9
    )
    points: int = parameter(2000, "of a scan at most", least=100, most=100_000)
    time: float = parameter(
        60.0, "until it is there; the robot waits", "s", least=0.0, most=3600.0
    )


def drawn_field(volume: Volume, seed: int) -> Field:
    """A smooth displacement whose length in the tumour is 1 at most."""
    rng = np.random.default_rng([seed, 18])
    p = volume.points(volume.labels == TUMOUR)
    length, middle = float(np.ptp(p, axis=0).max()), p.mean(axis=0)
    even = rng.normal(size=3)
    waves = rng.normal(size=(WAVES, 3))
    waves *= (2 * math.pi / (length * rng.uniform(*LENGTHS, (WAVES, 1)))) / (
        np.linalg.norm(waves, axis=1, keepdims=True)
    )
    turns, heights = rng.uniform(0.0, 2 * math.pi, WAVES), rng.normal(size=(WAVES, 3))

    def field(place: Array) -> Array:
        told: Array = even + np.sin((place - middle) @ waves.T + turns) @ heights
        return told

    most = float(np.linalg.norm(field(p), axis=1).max())
    return lambda place: field(place) / most


@dataclass
class Material:
    """Tissue as it was at first, and what of it is gone.

    Attributes:
        volume: Its grid and labels.
        gone: What was removed, (nx, ny, nz).
    """

    volume: Volume
    gone: NDArray[np.bool_]

    def __init__(self, volume: Volume) -> None:
        self.volume, labels = volume, volume.labels.copy()
        self.labels = labels
        self.fixed = np.isin(labels, (CHANNEL, CAP))
        self.gone = np.zeros(labels.shape, bool)
        self.border = signed_distance(labels == TUMOUR, [volume.spacing] * 3)
        self.to_critical = volume.to_critical.copy()
        self.places = volume.points(np.ones(labels.shape, bool))

    def at(self, d: Field, what: NDArray, order: int = 0) -> NDArray:
        """What lies at each place of the grid once the tissue is displaced."""
        index = self._index(self.places - d(self.places))
        told: NDArray = ndimage.map_coordinates(
            what, index.T, order=order, mode="nearest"
        ).reshape(self.labels.shape)
        return told

    def untouched(self) -> "Material":
        """The same as it was at first."""
        other = copy(self)
        other.gone = np.zeros(self.gone.shape, bool)
        return other

    def shown(
        self, d: Field, rim: float = 0.0
    ) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Labels, and what is gone, at each place of the grid; a rim counts healthy."""
        labels = np.where(self.at(d, self.border, 1) > rim, TUMOUR, BRAIN)
        if self.to_critical.size:
            labels[self.at(d, self.labels) == CRITICAL] = CRITICAL
        labels[self.fixed] = self.labels[self.fixed]
        return labels.astype(np.uint8), self.at(d, self.gone) | self.fixed

    def take(self, d: Field, freed: NDArray[np.bool_], labels: NDArray) -> None:
        """Removes what was freed at places of the grid, of the kind it is there."""
        index = np.rint(self._index(self.moved(d, self.places))).astype(int)
        on = ((index >= 0) & (index < self.labels.shape)).all(axis=1)
        at = tuple(np.where(on[:, None], index, 0).T)
        own = self.labels.reshape(-1)
        mine = on & freed[at] & ((labels[at] == TUMOUR) == (own == TUMOUR))
        self.gone |= mine.reshape(self.labels.shape) & ~self.fixed

    def moved(self, d: Field, material: Array) -> Array:
        """Where material lies once it is displaced, (n, 3)."""
        place = material
        for _ in range(3):
            place = material + d(place)
        return place

    def _index(self, place: Array) -> Array:
        index: Array = (place - self.volume.origin) / self.volume.spacing
        return index


class YieldingTissue:
    """What is really there, and what a robot does in it.

    Attributes:
        hits: Checks that found the body in tissue.
        nearest: Least distance of robot and tool to what is critical, in m, as the
            tissue was at first.
        way: Of the tool, in m.
    """

    def __init__(
        self,
        volume: Volume,
        params: TissueShiftParams,
        snake: SnakeParams,
        pitch: float,
    ) -> None:
        """Takes over a volume of which nothing is gone."""
        self.material, self._snake, self._pitch = Material(volume), snake, pitch
        self._params = check(params, "shift")
        self._field = drawn_field(volume, params.seed)
        self._whole = float(np.count_nonzero(volume.labels == TUMOUR))
        self.hits, self.nearest, self.way = 0, math.inf, 0.0
        self._freed = 0

    def twin(self) -> "YieldingTissue":
        """The same tissue before anything is gone, for what a robot believes."""
        other = copy(self)
        other.material = self.material.untouched()
        return other

    @property
    def resected(self) -> float:
        """Share of the tumour that is gone."""
        return self._count(TUMOUR) / self._whole

    @property
    def healthy(self) -> float:
        """Healthy tissue that is gone, over the tumour's volume."""
        return (self._count(BRAIN) + self._count(CRITICAL)) / self._whole

    def _count(self, label: int) -> float:
        m = self.material
        return float(np.count_nonzero(m.gone & (m.labels == label)))

    def displaced(self) -> Field:
        """The displacement as things stand."""
        size = self._params.most * self.resected
        return lambda place: size * self._field(place)

    def carry_out(self, postures: Array) -> None:
        """Goes through postures (n, 7); the tissue yields on the way."""
        first, most = 0, max(STEP / max(self._params.most, 1e-12), 1e-9) * self._whole
        while first < len(postures) - 1:
            first += self.stretch(postures[first:], self.displaced(), most)

    def stretch(self, postures: Array, d: Field, most: float = math.inf) -> int:
        """Carves what stands still, until so many voxels of tumour are gone.

        Returns:
            How many moves it went.
        """
        m = self.material
        labels, gone = m.shown(d)
        critical = m.at(d, m.to_critical, 1) if m.to_critical.size else m.to_critical
        carving = self._carving(labels, gone, critical)
        moves, freed = 0, 0
        while moves < len(postures) - 1 and freed < most:
            told: Any = carving.move(
                moves, postures[moves], postures[moves + 1], self._pitch
            )
            freed += told[0]
            self.hits += told[2]
            self.nearest = min(self.nearest, told[3])
            self.way += told[4]
            moves += 1
        m.take(d, (carving.volume.tau != SOLID) & ~gone, labels)
        return moves

    def _carving(self, labels: NDArray, gone: NDArray, critical: NDArray) -> Carving:
        volume = replace(
            self.material.volume.thought(),
            labels=labels,
            tau=np.where(gone, 0, SOLID).astype(np.int32),
            to_critical=critical.astype(np.float32),
        )
        return Carving(volume, self._snake, Execution(tau=volume.tau))

    def last_swept(self, postures: Array) -> NDArray[np.int64]:
        """The posture (n, 7) at which the tool last was at a voxel; -1 if never."""
        m, last = self.material, len(postures) - 1
        nothing = np.zeros(m.labels.shape, bool)
        carving = self._carving(m.labels, nothing, np.empty(0))
        for move in range(last):  # backwards: the last time comes first
            carving.move(move, postures[last - move], postures[last - move - 1], 1e-3)
        tau = carving.volume.tau.astype(np.int64)
        return np.where(tau == SOLID, -1, last + 1 - tau)

    def scan(self, params: CavityScanParams, rng: np.random.Generator) -> Array:
        """Points of the cavity's surface as a scan has them, (n, 3) in W, in m."""
        m, volume = self.material, self.material.volume
        points, _ = surface(m.gone | m.fixed, volume.origin, volume.spacing)
        points = points[apart(volume, points, m.fixed, CLEAR)]
        return self._seen(points, params, params.noise, rng)

    def image(
        self, params: CavityScanParams, rng: np.random.Generator
    ) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Labels, and what is free, as an image shows them; its borders are unsure."""
        m, spacing, d = self.material, self.material.volume.spacing, self.displaced()
        noise = ndimage.gaussian_filter(rng.normal(size=m.labels.shape), BLUR)
        noise *= params.image_noise / noise.std()
        labels, gone = m.shown(d)
        tumour = m.at(d, m.border, 1) + noise > 0.0
        labels = np.where(labels == CRITICAL, CRITICAL, np.where(tumour, TUMOUR, BRAIN))
        labels[m.fixed] = m.labels[m.fixed]
        cavity = signed_distance(gone, [spacing] * 3) + noise > 0.0
        return labels.astype(np.uint8), cavity | m.fixed

    def _seen(
        self,
        points: Array,
        params: CavityScanParams,
        noise: float,
        rng: np.random.Generator,
    ) -> Array:
        """Some points of a surface of the material where they are now."""
        points = self.material.moved(self.displaced(), points)
        rng.shuffle(points)
        points = points[: params.points]
        wanted = (1.0 - params.missing) * len(points)
        while len(points) > wanted:  # patches that something hides
            hidden = points[rng.integers(len(points))]
            far = np.linalg.norm(points - hidden, axis=1)
            count = min(len(points) - int(wanted), max(len(points) // 12, 1))
            points = points[np.argsort(far)[count:]]
        return points + noise * rng.normal(size=points.shape)


def apart(
    volume: Volume, points: Array, where: NDArray, least: float
) -> NDArray[np.bool_]:
    """Which points (n, 3) lie more than so many voxels from certain ones, (n,)."""
    far = ndimage.distance_transform_edt(~where)
    index = np.rint((points - volume.origin) / volume.spacing).astype(int)
    index = np.clip(index, 0, np.array(far.shape) - 1)
    told: NDArray[np.bool_] = far[tuple(index.T)] > least
    return told
