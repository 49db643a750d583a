"""What is drawn into a resection's replay: the tumour that shrinks, and Figure 7."""

from typing import Any

import numpy as np
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform

from diagrams.resection.metrics import carving_of, times_of
from plants.snake.last_module import meridian
from plants.snake.looks import SWEPT
from plants.tissue.labels import CAP, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from systems.resection.planning.procedure import widest_bend

TISSUE = Rgba(0.93, 0.72, 0.42, 0.5)
VESSEL = Rgba(0.75, 0.10, 0.12, 1.0)
ELEMENTARY_VOLUME = Rgba(0.95, 0.85, 0.10, 0.45)
STAGES = 28
BLOCK = 0.012
"""Edge in m of the blocks in which the surface is renewed."""


def coarse(mask: np.ndarray, every: int) -> np.ndarray:
    """A mask at every n-th voxel."""
    return mask[::every, ::every, ::every]


def shown_spacing(volume: Any) -> int:
    """How many voxels an edge of the shown mesh spans."""
    longest = max(volume.labels.shape) * volume.spacing
    return max(1, round(max(0.8e-3, longest / 60) / volume.spacing))


def draw_tissue(
    meshcat: Any, animation: Any, run: Any, first: int = 0, path: str = ""
) -> None:
    """The tumour in blocks whose visibility is animated, and the vessel.

    Args:
        meshcat: The Meshcat that records.
        animation: Its recording.
        run: Has carved.
        first: Index of the move that it began after.
        path: Of the frame that the tissue lies in, with a slash at its end.
    """
    volume = run.case.session.volume
    tau = carving_of(run).volume.tau
    moves = float(run.tissue.index.number[-1]) - first
    end = float(run.signals["time"][-1]) / run.replay_speed
    every = shown_spacing(volume)
    spacing = every * volume.spacing
    stages = np.linspace(0.0, 1.0, STAGES + 1)
    tissue = np.isin(volume.labels, (TUMOUR, CAP))
    shown: dict[tuple[int, ...], tuple[bytes, str]] = {}
    for number, share in enumerate(stages):
        gone = (tau <= first + share * moves) & (tau != SOLID)
        vertices, faces = surface(coarse(tissue & ~gone, every), volume.origin, spacing)
        blocks = _in_blocks(vertices, faces)
        frame = animation.frame(share * end)
        for key in set(shown) | set(blocks):
            piece = blocks.get(key)
            mark = piece[0].tobytes() if piece else b""
            if key in shown and shown[key][0] == mark:
                continue
            if key in shown and shown[key][1]:
                animation.SetProperty(frame, shown[key][1], "visible", False)
            name = ""
            if piece:
                block = "_".join(map(str, key)).replace("-", "m")
                name = f"{path}tissue/{block}/{number}"
                meshcat.SetTriangleMesh(name, piece[0].T, piece[1].T, TISSUE)
                if number > 0:
                    animation.SetProperty(0, name, "visible", False)
                animation.SetProperty(frame, name, "visible", True)
            shown[key] = (mark, name)
    _turn_to_entries(animation, carving_of(run).volume, first, moves, end, path)
    if (volume.labels == CRITICAL).any():
        vertices, faces = surface(
            coarse(volume.labels == CRITICAL, 1), volume.origin, volume.spacing
        )
        meshcat.SetTriangleMesh(f"{path}tissue/vessel", vertices.T, faces.T, VESSEL)


def decorate(meshcat: Any, animation: Any, run: Any) -> None:
    """The tumour that shrinks, the vessel, Figure 7."""
    volume = run.case.session.volume
    tissue = np.isin(volume.labels, (TUMOUR, CAP))
    draw_tissue(meshcat, animation, run, run.case.done.index)
    _elementary_volumes(meshcat, animation, run)
    _tools(meshcat, animation, run)
    # The study's view shows 6 cm; a smaller tumour is looked at from nearer.
    view = run.study.view
    nearer = min(1.0, float(np.ptp(volume.points(tissue), axis=0).max()) / 0.055)
    target = nearer * np.array(view.target)
    away = np.array(view.camera) - np.array(view.target)
    meshcat.SetCameraPose(target + nearer * away, target)


def _tools(meshcat: Any, animation: Any, run: Any) -> None:
    """Shows the ball that the robot carries: the plant has its first one throughout."""
    session = run.case.session
    if not session.tools:
        return
    station = run.diagram.GetSubsystemByName("station")
    plant = station.GetSubsystemByName("plant")
    inspector = station.GetSubsystemByName("scene_graph").model_inspector()
    body = plant.GetBodyByName("tool")
    frame = plant.GetBodyFrameIdOrThrow(body.index())
    names = [inspector.GetName(drawn) for drawn in inspector.GetGeometries(frame)]
    place = f"scene/{inspector.GetName(frame)}".replace("::", "/")
    own = [f"{place}/{n.replace('::', '/')}" for n in names if "shank" not in n]
    paths = {session.own.tool_radius: own}
    for tool in session.tools:
        if tool.radius not in paths:
            paths[tool.radius] = [f"{place}/ball{len(paths)}"]
            meshcat.SetObject(*paths[tool.radius], Sphere(tool.radius), Rgba(*SWEPT))
    times = times_of(run) / run.replay_speed
    changes = [0.0, *(times[tool.time] for tool in session.tools)]
    radii = [session.own.tool_radius, *(tool.radius for tool in session.tools)]
    for start, carried in zip(changes, radii, strict=True):
        for radius, parts in paths.items():
            for part in parts:
                shown = radius == carried
                animation.SetProperty(animation.frame(start), part, "visible", shown)


def _turn_to_entries(
    animation: Any, executed: Any, first: int, moves: float, end: float, path: str
) -> None:
    """Shows each entry's frame in turn: the robot stays, the tissue is turned."""
    if not executed.more:
        return
    for name in (f"{path}tissue", f"{path}elementary_volumes"):
        animation.SetTransform(0, name, RigidTransform())
        for channel in executed.more:
            share = max((channel.time - first) / max(moves, 1.0), 0.0)
            X_EW = RigidTransform(np.linalg.inv(channel.X_WE))
            animation.SetTransform(animation.frame(share * end), name, X_EW)


def _in_blocks(
    vertices: np.ndarray, faces: np.ndarray
) -> dict[tuple[int, ...], tuple[np.ndarray, np.ndarray]]:
    """The mesh cut into blocks: vertices and faces of each."""
    if len(faces) == 0:
        return {}
    key = np.floor(vertices[faces].mean(axis=1) / BLOCK).astype(int)
    unique, group = np.unique(key, axis=0, return_inverse=True)
    blocks = {}
    for number, name in enumerate(unique):
        own = faces[group.reshape(-1) == number]
        used, index = np.unique(own, return_inverse=True)
        blocks[tuple(int(k) for k in name)] = (
            vertices[used].round(6),
            index.reshape(own.shape).astype(np.int32),
        )
    return blocks


def dome(
    p_WI: np.ndarray, n: np.ndarray, bend: float, params: Any, rays: int = 48
) -> tuple[np.ndarray, np.ndarray]:
    """The surface that the tool's centre sweeps about an intermediate pose (Figure 7).

    Returns:
        Vertices in W in m (n, 3), and triangles (m, 3).
    """
    rings = 12
    r, z = meridian(np.linspace(0.0, bend, rings + 1), params)
    e = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.7 else [0.0, 1.0, 0.0])
    e /= np.linalg.norm(e)
    f = np.cross(n, e)
    turn = 2 * np.pi * np.arange(rays) / rays
    ring = np.cos(turn)[:, None] * e + np.sin(turn)[:, None] * f
    points = p_WI + r[:, None, None] * ring + z[:, None, None] * n
    index = np.arange((rings + 1) * rays).reshape(rings + 1, rays)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.concatenate(
        [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=0
    )
    return points.reshape(-1, 3), faces.reshape(-1, 3)


def _elementary_volumes(meshcat: Any, animation: Any, run: Any) -> None:
    """Each elementary procedure's first volume, while it is carried out."""
    session = run.case.session
    times = times_of(run) / run.replay_speed
    params = session.params
    for number, step in enumerate(session.steps):
        if step.kind not in ("elementary", "volume") or step.procedure is None:
            continue
        if step.last <= run.case.done.posture:
            continue  # carried out before this run
        n = step.procedure.axis()
        ahead = params.straight_module + params.tool_offset
        p_WI = np.array(step.procedure.position) - ahead * n
        bend = widest_bend(step.procedure, params)
        vertices, faces = dome(p_WI, n, bend, params)
        path = f"elementary_volumes/{number}"
        meshcat.SetTriangleMesh(path, vertices.T, faces.T, ELEMENTARY_VOLUME)
        animation.SetProperty(0, path, "visible", False)
        first, last = times[step.first], times[min(step.last, len(times) - 1)]
        animation.SetProperty(animation.frame(first), path, "visible", True)
        animation.SetProperty(animation.frame(last), path, "visible", False)
