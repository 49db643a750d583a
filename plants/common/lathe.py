"""Smooth, thin surfaces turned about the z axis, as meshes to look at."""

from collections.abc import Sequence
from functools import cache
import math

from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh


def lathe(
    profile: Sequence[tuple[float, float]],
    name: str,
    stretch: tuple[float, float] = (1.0, 1.0),
    spokes: int = 64,
) -> Mesh:
    """Turns a profile about z.

    Args:
        profile: Points (radius, z) in m, from one end of the surface to the other.
        name: Of the mesh.
        stretch: Factors along x and y that make the circles ellipses.
        spokes: Number of points of a circle.
    """
    text = _text(tuple(profile), name, stretch, spokes)
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", f"{name}.obj")), 1.0)


@cache
def _text(
    profile: tuple[tuple[float, float], ...],
    name: str,
    stretch: tuple[float, float],
    spokes: int,
) -> str:
    """The mesh as an OBJ file: the same for every diagram of a process."""
    a, b = stretch
    lines = [f"o {name}"]
    last = len(profile) - 1
    for i, (r, z) in enumerate(profile):
        before, after = profile[max(i - 1, 0)], profile[min(i + 1, last)]
        dr, dz = after[0] - before[0], after[1] - before[1]
        for k in range(spokes):
            c, s = (f(2.0 * math.pi * k / spokes) for f in (math.cos, math.sin))
            # Across both the profile's and the ellipse's tangent.
            nx, ny, nz = -dz * c / a, -dz * s / b, dr
            size = math.hypot(nx, ny, nz)
            lines.append(f"v {a * r * c:.5f} {b * r * s:.5f} {z:.5f}")
            lines.append(f"vn {nx / size:.4f} {ny / size:.4f} {nz / size:.4f}")
    for i in range(last):
        for k in range(spokes):
            p, q = i * spokes + k + 1, i * spokes + (k + 1) % spokes + 1
            corners = ((p, p + spokes, q + spokes), (p, q + spokes, q))
            for triangle in corners:
                lines.append("f " + " ".join(f"{v}//{v}" for v in triangle))
    return "\n".join(lines) + "\n"
