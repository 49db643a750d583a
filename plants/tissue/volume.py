"""The operated volume: tissue on a grid along the access channel.

Frame W is the channel's: z along it into the tumour, its origin where the axis
enters the tumour. The access robot's channel is a cylinder, prolonged to the first
depth at which its whole disc lies in the tumour; the tumour in it, the *cap*, is the
access robot's and counts neither as tumour nor as resected.

One integer a voxel, its arrival time, is free space, undo, replay and saved session
in one (`space`).
"""

from dataclasses import dataclass, field
import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import SOLID, Space, journals
from plants.tissue.tissue import Tissue, signed_distance
from systems.common.parameter import Rules, check, parameter

Vector = NDArray[np.float64]


@dataclass
class Access:
    """Where and how the access robot reaches the tumour."""

    # A point outside is where the channel starts.
    point: list[float] | None = parameter(
        None,
        "a point on the channel's axis in P; the tumour's centroid if left out",
        "m",
        least=-2.0,
        most=2.0,
        shape=(3,),
    )
    direction: list[float] | None = parameter(
        None,
        "of the channel, into the tumour, in P; proposed if left out",
        least=-1e3,
        most=1e3,
        shape=(3,),
    )
    clearance: float = parameter(
        1.0e-3, "of the body in the channel", "m", above=0.0, most=0.01
    )

    def rules(self) -> Rules:
        """A direction has a length."""
        n = self.direction
        yield n is None or math.hypot(*n) >= 1e-9, "direction", "a direction"


@dataclass
class Volume:
    """Labels and arrival times.

    Attributes:
        labels: BRAIN to CRITICAL, uint8 (nx, ny, nz).
        origin: Centre of voxel (0, 0, 0) in W, in m.
        spacing: Edge of a voxel in m.
        channel: Radius of the channel in m.
        depth: Where the channel ends, z in m.
        X_PW: Pose of W in the patient's frame, (4, 4).
        margin: Distance to what is critical that must be kept, in m.
        tau: Arrival times, int32 (nx, ny, nz).
    """

    labels: NDArray[np.uint8]
    origin: Vector
    spacing: float
    channel: float
    depth: float
    X_PW: Vector
    margin: float = 1.0e-3
    tau: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    inside: NDArray[np.float32] = field(init=False, repr=False)
    roomy: NDArray[np.uint8] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.tau.size == 0:
            start = np.isin(self.labels, (CHANNEL, CAP))
            self.tau = np.where(start, 0, SOLID).astype(np.int32)
        self.allowed = np.isin(self.labels, (TUMOUR, CHANNEL, CAP)).astype(np.uint8)
        if (self.labels == CRITICAL).any():
            far = self.distance_to_critical()
            self.allowed[far <= self.margin] = 0
        self.inside = ndimage.distance_transform_edt(self.allowed).astype(np.float32)
        self.roomy = np.zeros(self.labels.shape, np.uint8)
        self._journals = journals(self.labels.size)

    def distance_to_critical(self) -> NDArray:
        """Distance of each voxel's centre to what is critical, in m.

        Half a voxel is taken off: so far its surface may lie from its centres.
        """
        away = ndimage.distance_transform_edt(self.labels != CRITICAL)
        return self.spacing * (away - 0.5)

    @property
    def voxel(self) -> float:
        """Volume of a voxel in m3."""
        return self.spacing**3

    @property
    def tumour_volume(self) -> float:
        """Without the cap, in m3."""
        return float(np.count_nonzero(self.labels == TUMOUR)) * self.voxel

    @property
    def resected_volume(self) -> float:
        """Of the tumour, in m3."""
        return float(np.count_nonzero(self.resected)) * self.voxel

    @property
    def resected(self) -> NDArray[np.bool_]:
        """Which voxels are tumour that is gone, (nx, ny, nz)."""
        return (self.labels == TUMOUR) & (self.tau != SOLID)

    def space(self) -> Space:
        """The arrays for compiled functions; they are the volume's own."""
        return Space(
            self.tau.reshape(-1),
            self.allowed.reshape(-1),
            self.inside.reshape(-1),
            self.roomy.reshape(-1),
            tuple(self.labels.shape),
            (float(self.origin[0]), float(self.origin[1]), float(self.origin[2])),
            self.spacing,
            self.channel,
            self.depth,
            *self._journals,
        )

    def undo(self, time: int) -> None:
        """Puts back all that was freed after a time."""
        self.tau[(self.tau > time) & (self.tau != SOLID)] = SOLID
        self.forget_journals()
        self.roomy[:] = 0

    def forget_journals(self) -> None:
        """Makes what was freed until now final; it cannot be rolled back."""
        self._journals[2][:] = 0

    def at_time(self, time: int) -> NDArray[np.bool_]:
        """Which tumour voxels remain at a time, (nx, ny, nz)."""
        return (self.labels == TUMOUR) & (self.tau > time)

    def fresh(self) -> "Volume":
        """The same tissue before anything was removed; labels are shared."""
        copy = object.__new__(Volume)
        copy.__dict__.update(self.__dict__)
        start = np.isin(self.labels, (CHANNEL, CAP))
        copy.tau = np.where(start, 0, SOLID).astype(np.int32)
        copy.roomy = np.zeros_like(self.roomy)
        copy._journals = journals(self.labels.size)
        return copy

    def centre_of(self, voxel: int) -> Vector:
        """Where a voxel's centre lies in W, by its flat index."""
        index = np.unravel_index(voxel, self.labels.shape)
        return self.origin + self.spacing * np.array(index, float)

    def points(self, mask: NDArray[np.bool_]) -> Vector:
        """Centres of voxels in W, in m, (n, 3)."""
        return self.origin + self.spacing * np.argwhere(mask)

    def index_of(self, p_W: Vector) -> tuple[int, int, int]:
        """The voxel of a point in W, kept within the grid."""
        raw = np.rint((np.asarray(p_W) - self.origin) / self.spacing).astype(int)
        return tuple(np.clip(raw, 0, np.array(self.labels.shape) - 1))


def channel_frame(body: Tissue, access: Access) -> Vector:
    """X_PW of an access: z along it, the origin where it first meets the tumour.

    Raises:
        ValueError: If the line misses the tumour; it says by how much.
    """
    check(access)
    if access.direction is None:
        raise ValueError("access.direction is not given; propose one first")
    z = np.array(access.direction, float)
    z /= np.linalg.norm(z)
    given = access.point is not None
    through = np.array(access.point, float) if given else body.centre()
    X_VP = np.linalg.inv(body.X_PV)
    step = 0.25 * float(body.spacing.min())
    size = np.linalg.norm(body.X_PV[:3, :3] @ np.array(body.labels.shape, float))
    back = 0.0 if given and not _is_tumour(body, through[None], X_VP)[0] else size
    along = np.arange(-back, 2 * size, step)
    line = through + along[:, None] * z
    hit = _is_tumour(body, line, X_VP)
    if not hit.any():
        points = body.points() - through
        ahead = points[points @ z > 0.0]
        if len(ahead) == 0:
            raise ValueError(
                f"access.direction={access.direction} leads away from the tumour"
            )
        miss = np.linalg.norm(ahead - (ahead @ z)[:, None] * z, axis=1).min()
        raise ValueError(
            f"access.direction={access.direction} from point {access.point} misses "
            f"the tumour by {1e3 * miss:.1f} mm"
        )
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, 0], X[:3, 1], X[:3, 2] = x, np.cross(z, x), z
    X[:3, 3] = line[int(np.argmax(hit))]
    return X


def _is_tumour(body: Tissue, points: Vector, X_VP: Vector) -> NDArray[np.bool_]:
    index = np.rint(points @ X_VP[:3, :3].T + X_VP[:3, 3]).astype(int)
    inside = ((index >= 0) & (index < body.labels.shape)).all(axis=1)
    hit = np.zeros(len(points), bool)
    hit[inside] = body.labels[tuple(index[inside].T)] == TUMOUR
    return hit


def make_volume(
    body: Tissue,
    access: Access,
    body_radius: float,
    spacing: float = 0.5e-3,
    margin: float = 1.0e-3,
) -> Volume:
    """Resamples tissue by its shape onto a grid along the channel.

    Args:
        body: The tissue.
        access: The channel.
        body_radius: Of the robot, in m.
        spacing: Edge of a voxel in m.
        margin: To what is critical, in m.

    Raises:
        ValueError: If the spacing makes no sense, the access misses, is blocked or
            the channel's disc lies nowhere in the tumour.
    """
    if not 1e-4 <= spacing <= 5e-3:
        raise ValueError(
            f"spacing={spacing} m: expected 0.0001 to 0.005; nearest "
            f"{min(max(spacing, 1e-4), 5e-3):g}"
        )
    X_PW = channel_frame(body, access)
    X_WP = np.linalg.inv(X_PW)
    points = body.points() @ X_WP[:3, :3].T + X_WP[:3, 3]
    edge = float(np.abs(body.X_PV[:3, :3]).sum(axis=1).max()) / 2
    border = edge + 4 * spacing + margin
    channel = body_radius + access.clearance
    low = np.minimum(points.min(axis=0) - border, -channel - 2 * spacing)
    # A body part that reaches out of the channel's end must lie in the grid whole.
    low[2] = min(low[2], -3 * body_radius)
    high = np.maximum(points.max(axis=0) + border, channel + 2 * spacing)
    first = np.floor(low / spacing).astype(int)
    size = np.ceil(high / spacing).astype(int) - first + 1
    origin = first * spacing
    X_VW = np.linalg.inv(body.X_PV) @ X_PW
    labels = np.zeros(size, np.uint8)
    for label in (TUMOUR, CRITICAL):
        if (body.labels == label).any():
            labels[_resampled(body, label, X_VW, origin, spacing, size)] = label
    if not (labels == TUMOUR).any():
        raise ValueError(
            f"spacing={spacing} m: {body.name} vanishes between the voxels; "
            "choose a finer one"
        )
    labels = _alone(labels)
    return _with_channel(labels, origin, spacing, channel, X_PW, margin)


def _resampled(
    body: Tissue,
    label: int,
    X_VW: Vector,
    origin: Vector,
    spacing: float,
    size: Vector,
) -> NDArray[np.bool_]:
    """Where on the grid the shape of a label is."""
    mask = np.pad(body.labels == label, 2)
    shape = signed_distance(mask, body.spacing.tolist())
    matrix = spacing * X_VW[:3, :3]
    offset = X_VW[:3, :3] @ origin + X_VW[:3, 3] + 2
    far = float(shape.min())
    return (
        ndimage.affine_transform(
            shape, matrix, offset, tuple(size), order=1, mode="constant", cval=far
        )
        > 0.0
    )


def _alone(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Without specks of tumour that resampling may leave."""
    parts, count = ndimage.label(labels == TUMOUR)
    if count > 1:
        largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
        labels[(parts != largest) & (parts > 0)] = BRAIN
    return labels


def _with_channel(
    labels: NDArray[np.uint8],
    origin: Vector,
    spacing: float,
    channel: float,
    X_PW: Vector,
    margin: float,
) -> Volume:
    x, y, z = (origin[n] + spacing * np.arange(labels.shape[n]) for n in range(3))
    disc = x[:, None] ** 2 + y[None, :] ** 2 <= channel**2
    whole = (labels[disc] == TUMOUR).all(axis=0) & (z >= 0.0)
    if not whole.any():
        best = float((labels[disc] == TUMOUR).mean(axis=0).max())
        raise ValueError(
            f"access: the channel's disc of {1e3 * channel:.1f} mm radius lies nowhere "
            f"wholly in the tumour ({100 * best:.0f} % at best): choose another point "
            "or direction"
        )
    depth = float(z[int(np.argmax(whole))])
    tube = disc[:, :, None] & (z <= depth)[None, None, :]
    if (labels[tube] == CRITICAL).any():
        raise ValueError("access: the channel runs through what is critical")
    cap = tube & (labels == TUMOUR)
    labels[tube] = CHANNEL
    labels[cap] = CAP
    if not (labels == TUMOUR).any():
        raise ValueError("access: the channel takes the whole tumour")
    return Volume(labels, origin, spacing, channel, depth, X_PW, margin)
