"""What a replay shows of the wrist: true and estimated fulcrum, and the force."""

from typing import Any

from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform

from diagrams.common.replay import draw_arrow

METRES_PER_NEWTON = 0.03
"""Scale of the replay's force arrow."""


def draw_point(
    meshcat: Any, animation: Any, path: str, times: Any, points: Any, rgba: Any
) -> None:
    """A small ball that moves along `points` (n, 3) [m]."""
    meshcat.SetObject(path, Sphere(0.006), Rgba(*rgba))
    for index in range(0, len(times), 4):
        frame = animation.frame(times[index])
        animation.SetTransform(frame, path, RigidTransform(points[index]))


def decorate_wrist(meshcat: Any, animation: Any, run: Any) -> None:
    """True fulcrum (green), believed one (violet), the wall's force (orange)."""
    time = run.signals["time"]
    true = run.matrix("wall.fulcrum")[:, :3]
    believed = run.matrix("wrist.pivot")
    draw_point(meshcat, animation, "true_fulcrum", time, true, (0.16, 0.62, 0.3, 0.9))
    draw_point(
        meshcat, animation, "believed_fulcrum", time, believed, (0.55, 0.2, 0.75, 0.9)
    )
    draw_arrow(
        meshcat,
        animation,
        "wall_force",
        time,
        true,
        run.matrix("wall.force") * METRES_PER_NEWTON,
        (0.95, 0.6, 0.1, 1.0),
        step=4,
    )
