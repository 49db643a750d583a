"""The organs' looks: meshes in a SceneGraph that follow the organs' motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common import MemoryFile
from pydrake.common.value import Value
from pydrake.geometry import FramePoseVector, GeometryFrame, InMemoryMesh, Mesh
from pydrake.math import RigidTransform

from plants.common.looks import BOWEL, GALL, LIVER, STOMACH, illustration
from plants.organs.organs import Organ, surface_of
from plants.organs.shapes import SHAPES
from plants.organs.surface import Surface
from systems.common.block import Block
from systems.common.signal import Many
from systems.common.signals import MovingPoint

COLORS = dict(zip(SHAPES, (LIVER, GALL, STOMACH, BOWEL), strict=True))


def normals(surface: Surface) -> np.ndarray:
    """Unit normals at the vertices (n, 3)."""
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    total = np.zeros_like(surface.points)
    for corner in range(3):
        np.add.at(total, surface.triangles[:, corner], across)
    size = np.linalg.norm(total, axis=1)
    found: np.ndarray = total / np.maximum(size, 1e-30)[:, None]
    return found


def mesh_of(surface: Surface, name: str) -> Mesh:
    """A surface as Drake draws it."""
    lines = [f"o {name}"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in surface.points]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals(surface)]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in surface.triangles + 1]
    file = MemoryFile("\n".join(lines) + "\n", ".obj", f"{name}.obj")
    return Mesh(InMemoryMesh(mesh_file=file), 1.0)


class PosedOrgans(Block):
    """Poses the organs' meshes in a SceneGraph.

    Port ``organs`` accepts the `MovingPoint` of each organ.
    Port ``poses`` emits the frames' poses for the SceneGraph (FramePoseVector).
    """

    def __init__(self, scene_graph: Any, organs: Sequence[Organ]) -> None:
        """Registers the meshes; the SceneGraph must not be built yet."""
        super().__init__()
        self.source_id = scene_graph.RegisterSource("posed_organs")
        self._frames = []
        for organ in organs:
            frame = scene_graph.RegisterFrame(
                self.source_id, GeometryFrame(f"organ_{organ.name}")
            )
            mesh = mesh_of(surface_of(organ, 32), organ.name)
            color = COLORS[organ.shape]
            look = illustration(mesh, RigidTransform(), organ.name, color)
            scene_graph.RegisterGeometry(self.source_id, frame, look)
            self._frames.append(frame)
        names = tuple(organ.name for organ in organs)
        self._moved = self.signal_in("organs", Many(MovingPoint, names))
        self.value_out(
            "poses",
            lambda: Value(FramePoseVector()),
            self._calc_poses,
            {self._moved.ticket()},
        )

    def _calc_poses(self, context: Any, output: Any) -> None:
        poses = FramePoseVector()
        moved = self._moved.Eval(context).reshape(-1, 6)
        for frame, row in zip(self._frames, moved, strict=True):
            poses.set_value(frame, RigidTransform(row[:3]))
        output.set_value(poses)
