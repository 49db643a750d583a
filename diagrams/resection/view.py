"""A session in Meshcat: what is left, what is free, and how a proposal would go."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Cylinder, Rgba, Sphere
from pydrake.math import RigidTransform
from scipy import ndimage
from scipy.spatial import cKDTree

from diagrams.common.replay import dress
from diagrams.common.study import View
from diagrams.resection.replay import TISSUE, VESSEL, coarse, shown_spacing
from diagrams.snake.sliders import show_snake
from plants.snake.looks import CHANNEL, CHANNEL_LENGTH
from plants.tissue.labels import CAP, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from plants.tissue.volume import Volume
from systems.resection.planning.feasibility_map import FeasibilityMap
from systems.resection.planning.session import Session
from systems.resection.planning.trial import Preview

type Mask = NDArray[np.bool_]

FEASIBLE = np.array([0.15, 0.62, 0.30])
BLOCKED = np.array([0.80, 0.22, 0.18])
UNKNOWN = np.array([0.93, 0.72, 0.42])
FREE = Rgba(0.45, 0.66, 0.90, 0.35)
UNREACHED = Rgba(0.42, 0.24, 0.52, 0.55)
TRAIL = Rgba(0.12, 0.37, 0.85, 0.6)
IN_THE_WAY = Rgba(0.95, 0.05, 0.75, 1.0)


def show_session(
    meshcat: Any, session: Session, found: FeasibilityMap | None = None
) -> None:
    """Draws the remaining tumour, cut open along the channel, and the snake.

    Args:
        meshcat: Where to draw.
        session: How things stand.
        found: Colours the surface: green where an elementary volume is feasible
            now, red where none is; far from its points the tumour's own colour.
    """
    look_at(meshcat, session.volume)
    draw_tumour(meshcat, session, found)
    draw_around(meshcat, session)
    show_snake(meshcat, session.postures[-1], session.params)


def look_at(meshcat: Any, volume: Volume, X: NDArray | None = None) -> None:
    """Turns the camera to the tumour, as near as its size allows.

    Args:
        meshcat: Where to look.
        volume: With the tumour.
        X: Pose of W in the frame that is shown, (4, 4); z goes up.
    """
    X = np.eye(4) if X is None else X
    points = volume.points(volume.labels == TUMOUR)
    points = np.vstack([points, [0.0, 0.0, -0.7 * CHANNEL_LENGTH]])
    middle = X[:3, :3] @ ((points.min(axis=0) + points.max(axis=0)) / 2) + X[:3, 3]
    aside = X[:3, :3] @ [0.4, -0.9, 0.0] + [0.0, 0.0, 0.35]
    away = middle + 1.05 * float(np.ptp(points, axis=0).max()) * aside
    meshcat.SetTransform("/drake", RigidTransform(X))
    dress(meshcat, View(tuple(away), tuple(middle)))


def draw_tumour(
    meshcat: Any,
    session: Session,
    found: FeasibilityMap | None = None,
    reachable: Mask | None = None,
    is_open: bool = True,
) -> None:
    """Draws what is left of the tumour.

    Args:
        meshcat: Where to draw.
        session: How things stand.
        found: Colours of the surface, as in `show_session`.
        reachable: Tumour that can be reached, (nx, ny, nz): the rest has a colour of
            its own.
        is_open: Whether it is cut open towards the viewer.
    """
    volume = session.volume
    left = np.isin(volume.labels, (TUMOUR, CAP)) & (volume.tau == SOLID)
    if is_open:
        y = volume.origin[1] + volume.spacing * np.arange(left.shape[1])
        left[:, y < 0.0] = False
    if reachable is not None:
        _draw(meshcat, "unreached", volume, left & ~reachable, UNREACHED)
        left &= reachable
    if found is None or len(found.points) == 0 or not left.any():
        _draw(meshcat, "tumour", volume, left, TISSUE)
        return
    vertices, faces = _mesh(volume, left)
    away, nearest = cKDTree(found.points).query(vertices)
    colors = np.where(found.feasible[nearest, None], FEASIBLE, BLOCKED)
    colors = np.where((away > 2.5e-3)[:, None], UNKNOWN, colors)
    meshcat.SetTriangleColorMesh("tumour", vertices.T, faces.T, colors.T)


def draw_around(meshcat: Any, session: Session) -> None:
    """Draws channel, free space, what is critical, and the last step's way."""
    volume = session.volume
    outside = Cylinder(volume.channel, CHANNEL_LENGTH)
    meshcat.SetObject("channel", outside, Rgba(*CHANNEL))
    meshcat.SetTransform("channel", RigidTransform([0.0, 0.0, -CHANNEL_LENGTH / 2]))
    _draw(meshcat, "free", volume, volume.tau != SOLID, FREE)
    # Thin things are not to fall between the voxels that are shown.
    _draw(meshcat, "critical", volume, volume.labels == CRITICAL, VESSEL, 1)
    last = session.steps[-1] if session.steps else None
    if last is not None and last.last - last.first > 1:
        meshcat.SetLine("trail", session.tips[last.first : last.last].T, 1.0, TRAIL)
    else:
        meshcat.Delete("trail")


def draw_preview(meshcat: Any, session: Session, preview: Preview | None) -> None:
    """Draws how a proposal would go, and the first thing in its way."""
    volume = session.volume
    mask, rgba = np.zeros(volume.labels.shape, bool), Rgba()
    if preview is not None:
        mask, is_good = shape_of(volume, session, preview), preview.answer.feasible
        rgba = Rgba(*(FEASIBLE if is_good else BLOCKED), 0.6 if is_good else 0.4)
    _draw(meshcat, "proposal", volume, mask, rgba)
    where = None if preview is None else preview.answer.where
    if where is None:
        meshcat.Delete("in_the_way")
    else:
        meshcat.SetObject("in_the_way", Sphere(0.9e-3), IN_THE_WAY)
        meshcat.SetTransform("in_the_way", RigidTransform(where))
        arms = 5e-3 * np.eye(3)
        meshcat.SetLineSegments("in_the_way/cross", -arms, arms, 2.0, IN_THE_WAY)
        for path in ("in_the_way", "in_the_way/cross"):  # seen through all else
            meshcat.SetProperty(f"{path}/<object>", "material.depthTest", False)
            meshcat.SetProperty(f"{path}/<object>", "material.transparent", True)
            meshcat.SetProperty(f"{path}/<object>", "renderOrder", 1.0)
    x = session.postures[-1] if preview is None else preview.posture
    show_snake(meshcat, x, session.params)


def shape_of(volume: Volume, session: Session, preview: Preview) -> Mask:
    """What a proposal frees, or would have to if it is refused, (nx, ny, nz)."""
    mask = np.zeros(volume.labels.shape, bool)
    if preview.answer.feasible:
        mask.reshape(-1)[preview.freed] = True
    elif len(preview.tips):
        index = np.rint((preview.tips - volume.origin) / volume.spacing).astype(int)
        inside = ((index >= 0) & (index < volume.labels.shape)).all(axis=1)
        index = index[inside]
        if len(index) == 0:
            return mask
        radius = session.params.tool_radius / volume.spacing
        low = np.maximum(index.min(axis=0) - int(radius) - 1, 0)
        box = tuple(map(slice, low, index.max(axis=0) + int(radius) + 2))
        far = np.ones(mask[box].shape, bool)
        far[tuple((index - low).T)] = False
        mask[box] = ndimage.distance_transform_edt(far) <= radius
    return mask


def _draw(
    meshcat: Any, path: str, volume: Volume, mask: Mask, rgba: Rgba, every: int = 0
) -> None:
    """A mask's surface, of every n-th voxel; nothing if it is empty."""
    if not mask.any():
        meshcat.Delete(path)
        return
    vertices, faces = _mesh(volume, mask, every)
    meshcat.SetTriangleMesh(path, vertices.T, faces.T, rgba)


def _mesh(volume: Volume, mask: Mask, every: int = 0) -> tuple[NDArray, NDArray]:
    """Vertices in W (n, 3) and triangles (m, 3) of what of a mask is shown."""
    every = every or shown_spacing(volume)
    thin = coarse(mask, every)
    box = (ndimage.find_objects(thin.astype(np.uint8)) or [(slice(0, 1),) * 3])[0]
    low = every * np.array([side.start for side in box])
    return surface(
        thin[box], volume.origin + volume.spacing * low, every * volume.spacing
    )
