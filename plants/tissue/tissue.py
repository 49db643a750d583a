"""Labelled tissue as an image has it: a patient's mask, or a synthetic tumour.

Frame P is the patient's, LPS (x to the left, y to the back, z to the head). Voxels may
be longer along one axis than along another and lie at any angle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.tissue.labels import CRITICAL, TUMOUR
from systems.common.parameter import check, parameter


@dataclass
class Grid:
    """A grid of voxels.

    Attributes:
        sizes: Voxels along its axes, three.
        X_PI: From indices to P, (4, 4).
    """

    sizes: tuple[int, ...]
    X_PI: NDArray[np.float64]


@dataclass
class Tissue:
    """What lies where before the operation.

    Attributes:
        labels: BRAIN, TUMOUR or CRITICAL of each voxel, uint8 (nx, ny, nz).
        X_PV: From voxel indices (i, j, k, 1) to positions in P in m, (4, 4).
        name: Where it comes from.
        is_mask: Whether its voxels are what a mask has, and not only samples of a
            shape.
        notes: What had to be assumed, or was left out.
        image: The grid of the file it was read from; its own if None.
    """

    labels: NDArray[np.uint8]
    X_PV: NDArray[np.float64]
    name: str = ""
    is_mask: bool = False
    notes: list[str] = field(default_factory=list)
    image: Grid | None = None

    @property
    def grid(self) -> Grid:
        """The grid it was given on."""
        return self.image or Grid(self.labels.shape, self.X_PV)

    def __post_init__(self) -> None:
        spacing = self.spacing
        if self.labels.ndim != 3:
            raise ValueError(
                f"{self.name}: labels have {self.labels.ndim} axes, expected 3"
            )
        if not (np.isfinite(self.X_PV).all() and (spacing > 0.0).all()):
            raise ValueError(
                f"{self.name}: spacing of {1e3 * spacing} mm; voxels must be longer "
                "than zero along all three axes"
            )
        if not (self.labels == TUMOUR).any():
            raise ValueError(f"{self.name}: the mask is empty, no voxel is tumour")

    @property
    def spacing(self) -> NDArray[np.float64]:
        """Edges of a voxel in m, (3,)."""
        return np.linalg.norm(self.X_PV[:3, :3], axis=0)

    @property
    def tumour_volume(self) -> float:
        """In m3."""
        voxel = abs(np.linalg.det(self.X_PV[:3, :3]))
        return float(np.count_nonzero(self.labels == TUMOUR) * voxel)

    def points(self, label: int = TUMOUR) -> NDArray[np.float64]:
        """Positions in P of all voxels of a label, (n, 3)."""
        index = np.argwhere(self.labels == label)
        return index @ self.X_PV[:3, :3].T + self.X_PV[:3, 3]

    def centre(self) -> NDArray[np.float64]:
        """Where the tumour's centroid lies in P, (3,)."""
        return self.points().mean(axis=0)


def signed_distance(mask: NDArray[np.bool_], spacing: Sequence[float]) -> NDArray:
    """Distance to a mask's border in m, > 0 inside: its shape, to be resampled."""
    inside = ndimage.distance_transform_edt(mask, spacing)
    outside = ndimage.distance_transform_edt(~mask, spacing)
    return (inside - outside).astype(np.float32)


def parts_by_size(
    mask: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Parts of a mask that are connected by faces.

    Returns:
        The number of each voxel's part, 1 for the largest, 0 outside; and the parts'
        sizes in voxels from the largest on, (n,).
    """
    parts, _ = ndimage.label(mask)
    sizes = np.bincount(parts.ravel())[1:]
    order = np.argsort(-sizes, kind="stable")
    number = np.zeros(len(sizes) + 1, int)
    number[order + 1] = np.arange(1, len(sizes) + 1)
    return number[parts], sizes[order]


@dataclass
class SyntheticTumour:
    """A seeded, irregular, lobed tumour, with a vessel beside it if wanted."""

    length: float = parameter(
        0.030,
        "longest side of its bounding box; 0.03 to 0.08 in the paper (II.B)",
        "m",
        least=0.005,
        most=0.1,
    )
    lobes: int = parameter(5, "lobes about its core", least=0, most=20)
    roughness: float = parameter(
        0.04, "height of its bumps over its radius", least=0.0, most=0.3
    )
    vessel: float = parameter(
        0.0,
        "radius of a critical vessel beside it; 0 for none",
        "m",
        least=0.0,
        most=0.01,
    )
    vessel_gap: float = parameter(
        0.0005,
        "between the vessel's wall and the tumour's surface",
        "m",
        least=0.0,
        most=0.02,
    )
    seed: int = parameter(1, "of its shape", least=0, most=2**63 - 1)


def _shape(params: SyntheticTumour, points: NDArray) -> NDArray:
    """> 0 inside a tumour of radius about one; points (..., 3)."""
    rng = np.random.default_rng(params.seed)
    fields: list[NDArray] = [0.80 - np.linalg.norm(points, axis=-1)]
    for _ in range(params.lobes):
        direction = rng.normal(size=3)
        centre = rng.uniform(0.45, 0.65) * direction / np.linalg.norm(direction)
        fields.append(
            rng.uniform(0.38, 0.52) - np.linalg.norm(points - centre, axis=-1)
        )
    # A soft union: lobes run into each other without a crease.
    soft = 0.06
    field = soft * np.logaddexp.reduce([f / soft for f in fields], axis=0)
    for _ in range(6):
        wave = rng.normal(size=3)
        wave *= rng.uniform(3.0, 7.0) / np.linalg.norm(wave)
        phase = rng.uniform(0.0, 2 * math.pi)
        field += params.roughness * np.sin(points @ wave + phase) / math.sqrt(3)
    return field


def synthetic_tumour(params: SyntheticTumour, spacing: float = 1.0e-3) -> Tissue:
    """Makes a synthetic tumour about the origin of P.

    Args:
        params: Its shape.
        spacing: Edge of a voxel in m; shapes are resampled finer later.

    Returns:
        The tissue, the voxels' axes along those of P.
    """
    check(params, "tumour")
    axis = np.linspace(-1.5, 1.5, 61)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    inside = np.argwhere(_shape(params, grid) > 0.0)
    scale = params.length / (0.05 * (np.ptp(inside, axis=0).max() + 1))
    half = int(math.ceil(1.4 * scale / spacing))
    line = np.arange(-half, half + 1) * spacing
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1)
    numbers, _ = parts_by_size(_shape(params, grid / scale) > 0.0)
    mask = numbers == 1
    labels = mask.astype(np.uint8)
    if params.vessel > 0.0:
        labels[_vessel(params, mask, line, grid)] = CRITICAL
    X = np.eye(4)
    X[:3, :3] *= spacing
    X[:3, 3] = line[0]
    return Tissue(labels, X, f"synthetic tumour {params.seed}")


def _vessel(
    params: SyntheticTumour, mask: NDArray, axis: NDArray, grid: NDArray
) -> NDArray[np.bool_]:
    """A slightly wavy tube along y that passes the tumour's +x side."""
    distance = -signed_distance(mask, [axis[1] - axis[0]] * 3)
    middle = 0.12 * params.length * np.sin(grid[..., 1] / params.length * 4.0)
    for x in axis[axis > 0.0]:
        away = np.hypot(grid[..., 0] - x, grid[..., 2] - middle)
        tube = away <= params.vessel
        if distance[tube].min() >= params.vessel_gap:
            return tube
    raise ValueError(f"tumour.vessel={params.vessel} m: no place beside the tumour")
