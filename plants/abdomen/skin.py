"""The look of the abdomen: a translucent, inflated belly."""

from collections.abc import Sequence
import math
from typing import Any

from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh
from pydrake.math import RigidTransform

from plants.common.looks import SKIN, draw

HALF_LENGTH, HALF_WIDTH, HEIGHT = 0.27, 0.21, 0.15
"""Half axes of the belly along y and x, and its height, in m."""


def belly_obj(rings: int = 24, spokes: int = 64) -> str:
    """A dome with a flat top and round sides, as OBJ text with smooth normals.

    z = HEIGHT ((1 - r^4)^(1/2) - 1) over an ellipse of radius r: within 2 mm of
    the plane z = 0 for r < 0.4 (some 80 mm), where the trocars stand.
    """
    lines = ["o belly"]
    for i in range(rings + 1):
        slope = 0.5 * math.pi * i / rings
        r = math.sin(slope) ** 0.5 if i else 0.0
        z = HEIGHT * (math.cos(slope) - 1.0)
        for k in range(spokes):
            angle = 2.0 * math.pi * k / spokes
            x, y = HALF_WIDTH * r * math.cos(angle), HALF_LENGTH * r * math.sin(angle)
            # Gradient of (z / HEIGHT + 1)^2 + r^4 - 1.
            ux, uy = x / HALF_WIDTH**2, y / HALF_LENGTH**2
            gradient = (
                4.0 * r * r * ux,
                4.0 * r * r * uy,
                2.0 * math.cos(slope) / HEIGHT,
            )
            size = math.hypot(*gradient) or 1.0
            n = [g / size for g in gradient]
            lines.append(f"v {x:.5f} {y:.5f} {z:.5f}")
            lines.append(f"vn {n[0]:.4f} {n[1]:.4f} {n[2]:.4f}")
    for i in range(rings):
        for k in range(spokes):
            a, b = i * spokes + k + 1, i * spokes + (k + 1) % spokes + 1
            c, d = b + spokes, a + spokes
            lines.append(f"f {a}//{a} {d}//{d} {c}//{c}")
            if i:  # the first ring is the top point itself
                lines.append(f"f {a}//{a} {c}//{c} {b}//{b}")
    return "\n".join(lines) + "\n"


def draw_skin(plant: Any, wall: Any, p_PG: Sequence[float]) -> None:
    """Draws the belly on the wall's body, its top at the parent's origin."""
    mesh = InMemoryMesh(mesh_file=MemoryFile(belly_obj(), ".obj", "belly.obj"))
    X_wall = RigidTransform([-x for x in p_PG])
    draw(plant, wall, Mesh(mesh, 1.0), X_wall, "skin", SKIN)
