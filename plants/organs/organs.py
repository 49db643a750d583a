"""The organs of a scenario: what they are, and what blocks get of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Multiplexer,
    TrajectorySource,
)

from plants.abdomen.organ_motion import OrganMotionParams, organ_trajectory
from plants.abdomen.wall_motion import WallMotionParams
from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.distance_grid import ERROR, SPACING, DistanceGrid, kept
from plants.organs.reading import UNITS, read_surface
from plants.organs.shapes import DETAIL, SHAPES, shape
from plants.organs.surface import Surface, refuse_open, refuse_size
from systems.common.parameter import Rules, parameter, part
from systems.common.signal import Many, size
from systems.common.signals import MovingPoint

PLAN_ROOM = 0.0025
"""Ways are planned with so much more than is held, m."""


@dataclass
class Organ:
    """An organ: its surface, where it is, how it yields, how it moves."""

    name: str = parameter("", "by which keys, log and figures go")
    shape: str = parameter(
        "liver", "of a synthetic one, if there is no file", choices=tuple(SHAPES)
    )
    seed: int = parameter(0, "of its bumps", least=0, most=2**63 - 1)
    file: str = parameter(
        "", "OBJ, STL or VTK of its surface; a synthetic one if empty", file=True
    )
    unit: str = parameter("mm", "of the file", choices=tuple(UNITS))
    mend: bool = parameter(False, "whether a surface that is not closed is mended")
    scale: float = parameter(1.0, "of its size", least=0.2, most=5.0)
    p_WO: list[float] = parameter(
        [0.0, 0.0, -0.16], "of its frame, at rest", "m", least=-1, most=1, shape=(3,)
    )
    rpy: list[float] = parameter(
        [0.0, 0.0, 0.0], "roll, pitch, yaw of it", "rad", least=-7, most=7, shape=(3,)
    )
    margin: float = parameter(
        0.002, "kept from the surface of shaft and gauze", "m", least=0.0, most=0.03
    )
    stiffness: float = parameter(
        500.0, "of its surface under a tip", "N/m", least=10.0, most=5000.0
    )
    damping: float = parameter(1.0, "the same", "N s/m", least=0.0, most=20.0)
    motion: OrganMotionParams = part(OrganMotionParams)

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        motion = self.motion
        return not (any((*motion.breathing, *motion.cough)) or motion.recording)

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield self.name.isidentifier(), "name", "letters, digits and _"


class OrganSet(NamedTuple):
    """Organs as blocks take them; the first index of both arrays is 0.

    Attributes:
        names: Of the organs.
        values: See `distance.Organs`, (1, N).
        table: See there, (1, n, 10).
    """

    names: tuple[str, ...]
    values: np.ndarray
    table: np.ndarray

    @classmethod
    def nothing(cls) -> "OrganSet":
        """One organ that is nowhere near: a block alone has it."""
        row = [100.0, 100.0, 100.0, SPACING, 2, 2, 2, 0, 0.0, 0.0]
        return cls(("organ",), np.ones((1, 8), np.float32), np.array([[row]]))


def arrays(organs: OrganSet | None) -> list[np.ndarray]:
    """The constants of a block among organs; none without."""
    return [] if organs is None else [organs.values, organs.table]


def port(organs: OrganSet | None) -> dict[str, Any]:
    """The port of a block among organs that takes how they move; none without."""
    return {} if organs is None else {"organs": Many(MovingPoint, organs.names)}


def surface_of(organ: Organ, detail: int = DETAIL) -> Surface:
    """An organ's closed surface in W, at rest, m; a synthetic one of some detail.

    Raises:
        SurfaceError: If it is not closed, or of no organ's size.
    """
    if organ.file:
        own = read_surface(organ.file, organ.unit, organ.mend, organ.name)
    else:
        own = shape(organ.shape, organ.seed, detail)
    X_WO = RigidTransform(RollPitchYaw(organ.rpy), organ.p_WO)
    points = X_WO.multiply((organ.scale * own.points).T).T
    surface = Surface(np.ascontiguousarray(points), own.triangles)
    refuse_open(surface, organ.name)
    refuse_size(surface, organ.name)
    return surface


def grids_of(organs: Sequence[Organ]) -> list[DistanceGrid]:
    """Their grids in W.

    Raises:
        SurfaceError: As `surface_of`, and if one crosses itself.
    """
    return [kept(surface_of(organ), organ.name) for organ in organs]


def organ_set(organs: Sequence[Organ]) -> OrganSet:
    """What blocks get of the organs.

    Raises:
        SurfaceError: As `grids_of`.
    """
    rows, first, grids = [], 0, grids_of(organs)
    for organ, grid in zip(organs, grids, strict=True):
        safe = GAUZE_RADIUS + organ.margin + ERROR
        counts = grid.values.shape
        rows.append(
            [*grid.origin, grid.spacing, *counts, first, safe, safe + PLAN_ROOM]
        )
        first += grid.values.size
    values = np.concatenate([grid.values.ravel() for grid in grids])
    names = tuple(organ.name for organ in organs)
    return OrganSet(names, values[None], np.array(rows)[None])


def add_organ_motions(
    builder: Any, organs: Sequence[Organ], wall: WallMotionParams, duration: float
) -> Any:
    """Adds what moves the organs: native sources, no Python.

    Args:
        builder: The diagram's builder.
        organs: The organs.
        wall: Whose breath they follow.
        duration: How long it is needed, s.

    Returns:
        The system `organs`, whose port `y0` emits a `MovingPoint` for each: its
        displacement and velocity.
    """
    count = size(MovingPoint)
    if all(organ.still for organ in organs):
        still = ConstantVectorSource([0.0] * count * len(organs))
        return builder.AddNamedSystem("organs", still)
    gathered = builder.AddNamedSystem("organs", Multiplexer([count] * len(organs)))
    for index, organ in enumerate(organs):
        motion = organ_trajectory(organ.motion, wall, [0.0] * 3, duration)
        source = builder.AddNamedSystem(
            f"organ_{organ.name}", TrajectorySource(motion, 1)
        )
        builder.Connect(source.get_output_port(), gathered.get_input_port(index))
    return gathered
