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

from plants.tissue.critical import Boxes, cover
from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import SOLID, Space, as_bits, journals
from plants.tissue.tissue import Grid, Tissue, parts_by_size, signed_distance
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
class Channel:
    """A further access channel of a volume.

    Attributes:
        X_WE: Its frame E in W, z along it, the origin at the tumour's border, (4, 4).
        depth: Where it ends, z in E in m.
        time: Arrival time of what it frees.
    """

    X_WE: Vector
    depth: float
    time: int


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
        critical: The mask's voxels that are critical; the grid's own if None.
        to_critical: Distance of each voxel's centre to them in m, float32 (nx, ny,
            nz); empty if nothing is critical.
        mask_volume: Of the tumour as the mask has it, in m3; None if it is synthetic.
        notes: What was left out on the way here.
        more: Channels beside the first, in the order in which they are bored.
        image: The grid on which the tissue was given; None if it is not known.
    """

    labels: NDArray[np.uint8]
    origin: Vector
    spacing: float
    channel: float
    depth: float
    X_PW: Vector
    margin: float = 1.0e-3
    tau: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    critical: Boxes | None = None
    to_critical: NDArray[np.float32] = field(
        default_factory=lambda: np.empty(0, np.float32), repr=False
    )
    mask_volume: float | None = None
    notes: list[str] = field(default_factory=list)
    more: list[Channel] = field(default_factory=list)
    image: Grid | None = None
    inside: NDArray[np.float32] = field(init=False, repr=False)
    roomy: NDArray[np.uint8] = field(init=False, repr=False)
    solid: NDArray[np.int64] = field(init=False, repr=False)
    barred: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.tau.size == 0:
            start = np.isin(self.labels, (CHANNEL, CAP))
            self.tau = np.where(start, 0, SOLID).astype(np.int32)
        if self.critical is None and (self.labels == CRITICAL).any():
            X = np.diag([self.spacing] * 3 + [1.0])
            X[:3, 3] = self.origin
            self.critical = Boxes(np.argwhere(self.labels == CRITICAL), X)
        if self.critical is not None and self.to_critical.size == 0:
            _, self.to_critical = cover(
                self.critical, self.origin, self.spacing, self.labels.shape
            )
        self._journals = journals(self.labels.size)
        self.allow()
        self.refresh()

    def may_be_removed(self) -> NDArray[np.uint8]:
        """1 where the tool may be: tumour and channels, off what is critical."""
        allowed = np.isin(self.labels, (TUMOUR, CHANNEL, CAP))
        for channel in self.more:
            allowed |= self.tube(channel)
        if self.to_critical.size:
            allowed &= self.to_critical > self.margin
        return allowed.astype(np.uint8)

    def retarget(
        self,
        body: Tissue,
        seen: NDArray[np.bool_] | None = None,
        opened: NDArray[np.bool_] | None = None,
        time: int = 0,
    ) -> None:
        """Takes over what is there now; what is gone stays gone, and counts as it did.

        Args:
            body: The tissue of an image taken meanwhile, of what is left.
            seen: Voxels that a scan of the cavity found to be tissue, (nx, ny, nz):
                they are there though they were thought to be gone.
            opened: Voxels that tissue left, (nx, ny, nz): they are free though
                nothing was cut there, and count as tumour that is gone.
            time: Arrival time of these.

        Raises:
            ValueError: If the tumour that is left lies beyond the grid.
        """
        X_WV = np.linalg.inv(self.X_PW) @ body.X_PV
        place = body.points() @ np.linalg.inv(self.X_PW)[:3, :3].T
        place += np.linalg.inv(self.X_PW)[:3, 3]
        index = np.rint((place - self.origin) / self.spacing)
        beyond = ~((index >= 0) & (index < self.labels.shape)).all(axis=1)
        if beyond.any():
            raise ValueError(
                f"{body.name}: {100 * beyond.mean():.1f} % of its tumour lie beyond "
                "the session's grid: expected the same tumour in the same frame"
            )
        size = np.array(self.labels.shape)
        left = _tumour_on_grid(
            body, np.linalg.inv(X_WV), self.origin, self.spacing, size
        )
        if seen is not None:
            self.tau[seen & (self.tau > 0)] = SOLID
        if opened is not None:
            opened = opened & (self.tau == SOLID)
            self.tau[opened], self.labels[opened] = time, TUMOUR
        kept = np.isin(self.labels, (CHANNEL, CAP)) | (
            (self.labels == TUMOUR) & (self.tau != SOLID)
        )
        labels = np.where(left, TUMOUR, BRAIN).astype(np.uint8)
        if (body.labels == CRITICAL).any():
            self.critical = Boxes(np.argwhere(body.labels == CRITICAL), X_WV)
            covered, self.to_critical = cover(
                self.critical, self.origin, self.spacing, self.labels.shape
            )
            labels[covered] = CRITICAL
        else:
            labels[self.labels == CRITICAL] = CRITICAL
        self.labels = np.where(kept, self.labels, labels).astype(np.uint8)
        self.allow()
        self.refresh()

    def refresh(self) -> None:
        """Makes all that follows from arrival times agree with them."""
        self.forget_journals()
        self.roomy = np.zeros(self.labels.shape, np.uint8)
        self.solid = as_bits(self.tau == SOLID)

    def tube(self, channel: Channel) -> NDArray[np.bool_]:
        """Voxels in a channel, (nx, ny, nz)."""
        X_EW = np.linalg.inv(channel.X_WE)
        sides = [
            self.origin[r] + self.spacing * np.arange(self.labels.shape[r])
            for r in range(3)
        ]
        x, y, z = np.ix_(*sides)
        p, q, r = (X[0] * x + X[1] * y + X[2] * z + X[3] for X in X_EW[:3])
        return (r <= channel.depth) & (p * p + q * q <= self.channel**2)

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
            self.solid,
            self.barred,
            tuple(self.labels.shape),
            -(-self.labels.shape[2] // 64),
            (float(self.origin[0]), float(self.origin[1]), float(self.origin[2])),
            self.spacing,
            self.channel,
            np.array(
                [[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, self.depth]]
                + [[*c.X_WE[:3, 3], *c.X_WE[:3, 2], c.depth] for c in self.more]
            ),
            *self._journals,
        )

    def undo(self, time: int) -> None:
        """Puts back all that was freed after a time."""
        self.tau[(self.tau > time) & (self.tau != SOLID)] = SOLID
        if any(channel.time > time for channel in self.more):
            self.more = [c for c in self.more if c.time <= time]
            self.allow()
        self.refresh()

    def allow(self) -> None:
        """Makes where the tool may be agree with the channels."""
        self.allowed = self.may_be_removed()
        self.barred = as_bits(self.allowed == 0)
        self.inside = ndimage.distance_transform_edt(self.allowed).astype(np.float32)

    def bore(self, channel: Channel) -> None:
        """Bores a further channel: what lies in it is gone, and the tool may be there.

        Raises:
            ValueError: If something critical is nearer than the margin.
        """
        tube = self.tube(channel)
        if self.to_critical.size and (self.to_critical[tube] <= self.margin).any():
            raise ValueError("access: the channel runs through what is critical")
        self.tau[tube & (self.tau == SOLID)] = channel.time
        self.more.append(channel)
        self.allow()
        self.refresh()

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
        copy._journals = journals(self.labels.size)
        copy.refresh()
        copy.more = []
        if self.more:
            copy.allow()
        return copy

    def thought(self) -> "Volume":
        """The same tissue as it is now, to be changed without consequence."""
        copy = object.__new__(Volume)
        copy.__dict__.update(self.__dict__)
        copy.tau, copy.roomy = self.tau.copy(), self.roomy.copy()
        copy.solid, copy._journals = self.solid.copy(), journals(self.labels.size)
        copy.more = list(self.more)
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
    X_WV = X_WP @ body.X_PV
    labels = np.zeros(size, np.uint8)
    labels[_tumour_on_grid(body, np.linalg.inv(X_WV), origin, spacing, size)] = TUMOUR
    if not (labels == TUMOUR).any():
        raise ValueError(
            f"spacing={spacing} m: {body.name} vanishes between the voxels; "
            "choose a finer one"
        )
    notes: list[str] = []
    critical, to_critical = None, np.empty(0, np.float32)
    if (body.labels == CRITICAL).any():
        critical = Boxes(np.argwhere(body.labels == CRITICAL), X_WV)
        covered, to_critical = cover(critical, origin, spacing, labels.shape)
        both = np.count_nonzero(covered & (labels == TUMOUR)) * spacing**3
        if both > 0.0:
            notes.append(
                f"{1e9 * both:.3g} mm3 of the tumour share voxels of {1e3 * spacing:g} "
                "mm with what is critical and are left to it"
            )
        labels[covered] = CRITICAL
    parts, sizes = parts_by_size(labels == TUMOUR)
    if len(sizes) > 1:
        labels[parts > 1] = BRAIN
        notes.append(
            f"{1e9 * sizes[1:].sum() * spacing**3:.3g} mm3 of the tumour in "
            f"{len(sizes) - 1} parts hang together with it by no face on the grid of "
            f"{1e3 * spacing:g} mm and are left out"
        )
    depth = _cut_channel(labels, origin, spacing, channel)
    if critical is not None and critical.meet_tube(channel, depth):
        raise ValueError("access: the channel runs through what is critical")
    return Volume(
        labels,
        origin,
        spacing,
        channel,
        depth,
        X_PW,
        margin,
        critical=critical,
        to_critical=to_critical,
        mask_volume=body.tumour_volume if body.is_mask else None,
        notes=notes,
        image=body.grid,
    )


def _tumour_on_grid(
    body: Tissue, X_VW: Vector, origin: Vector, spacing: float, size: Vector
) -> NDArray[np.bool_]:
    """Where the tumour's shape is on the grid.

    The shape is the signed distance to the mask's border, which reads between voxels.
    Slices thicker than the voxels of a slice are stacks of steps: the distance is that
    to the steps, smoothed along them by half a slice, which leads from each outline to
    the next and leaves a single slice as thick as it is.

    Any such field shrinks what is convex, thick slices most (8 mm in slices of 10 mm:
    by 60 %). So the border is not the field's zero but the level that encloses the
    volume of the mask itself. A synthetic tumour is its shape, of which the voxels are
    only samples: there it is the zero.
    """
    tumour = np.argwhere(body.labels == TUMOUR)
    corner, end = tumour.min(axis=0) - 2, tumour.max(axis=0) + 3
    mask = np.zeros(end - corner, bool)
    mask[tuple((tumour - corner).T)] = True
    steps = np.maximum(np.rint(body.spacing / body.spacing.min()).astype(int), 1)
    for axis in range(3):
        mask = np.repeat(mask, steps[axis], axis)
    shape = signed_distance(mask, (body.spacing / steps).tolist())
    if (steps > 1).any():
        shape = ndimage.gaussian_filter(shape, np.where(steps > 1, steps / 2, 0.0))
    if body.is_mask:
        # On a flat face all voxels are alike: those nearer to the middle come first.
        away = np.indices(shape.shape) - np.argwhere(mask).mean(axis=0)[:, *[None] * 3]
        edges = (body.spacing / steps)[:, *[None] * 3]
        shape -= 1e-4 * np.linalg.norm(edges * away, axis=0)
    matrix = steps[:, None] * (spacing * X_VW[:3, :3])
    first = X_VW[:3, :3] @ origin + X_VW[:3, 3] - corner
    field = ndimage.affine_transform(
        shape,
        matrix,
        steps * first + (steps - 1) / 2,
        tuple(size),
        order=1,
        mode="constant",
        cval=float(shape.min()),
    )
    if not body.is_mask:
        return field > 0.0
    count = round(body.tumour_volume / spacing**3)
    if count == 0:
        return np.zeros(size, bool)
    return field >= np.partition(field.ravel(), -count)[-count]


def _cut_channel(
    labels: NDArray[np.uint8], origin: Vector, spacing: float, channel: float
) -> float:
    """Labels channel and cap, and returns where the channel ends, z in m."""
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
    return depth
