"""Surfaces from files: OBJ, STL and VTK, read and mended by PyVista."""

from pathlib import Path
from typing import Any

import numpy as np

from plants.organs.surface import Surface, SurfaceError, open_edges, refuse_open

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
KINDS = (".obj", ".stl", ".vtk", ".vtp", ".ply")


def read_surface(file: str, unit: str, mend: bool, name: str) -> Surface:
    """The surface in a file, m.

    Args:
        file: OBJ, STL or VTK.
        unit: One of `UNITS`.
        mend: Whether points are joined, holes closed and faces turned if need be.
        name: Of the organ, for errors.

    Raises:
        SurfaceError: If it is none, or not closed; it says where it is open.
    """
    path = Path(file)
    if path.suffix.lower() not in KINDS or not path.is_file():
        raise SurfaceError(f"{name}.file={file!r}: expected a file, {', '.join(KINDS)}")
    try:
        import pyvista
    except ModuleNotFoundError as error:
        raise SurfaceError(
            f"{name}.file={file!r}: no module {error.name!r}: this needs the extra "
            "organs, pip install 'trocar[organs]'"
        ) from error
    try:
        mesh = pyvista.read(path)
        mesh = mesh.extract_surface(algorithm=None).triangulate().clean()
    except Exception as error:
        raise SurfaceError(
            f"{name}.file={file!r}: it cannot be read: {error}"
        ) from None
    surface = _surface(mesh, UNITS[unit])
    if len(surface.triangles) and len(open_edges(surface)) and mend:
        size = float(np.linalg.norm(np.ptp(surface.points, axis=0))) / UNITS[unit]
        mesh = mesh.fill_holes(0.5 * size).clean()
        mesh = mesh.compute_normals(
            auto_orient_normals=True, consistent_normals=True, split_vertices=False
        )
        surface = _surface(mesh, UNITS[unit])
    refuse_open(surface, f"{name}.file={file!r}")
    return surface


def _surface(mesh: Any, scale: float) -> Surface:
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 4)[:, 1:]
    return Surface(scale * np.asarray(mesh.points, float), np.ascontiguousarray(faces))
