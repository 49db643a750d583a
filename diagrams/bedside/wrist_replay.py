"""What a replay shows of the wrist: true and estimated fulcrum, and the force."""

from typing import Any

from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform

from diagrams.common.replay import draw_arrow, thinned

METRES_PER_NEWTON = 0.03
"""Scale of the replay's force arrow."""


def draw_point(
    meshcat: Any,
    animation: Any,
    path: str,
    times: Any,
    points: Any,
    radius: float,
    rgba: Any,
) -> None:
    """A ball that moves along `points` (n, 3) [m]; wider than the trocar's tube."""
    meshcat.SetObject(path, Sphere(radius), Rgba(*rgba))
    for index in range(0, len(times), 4 * thinned(len(times) // 4)):
        frame = animation.frame(times[index])
        animation.SetTransform(frame, path, RigidTransform(points[index]))


def decorate_wrist(meshcat: Any, animation: Any, run: Any) -> None:
    """True fulcrum (green), believed one (violet), the wall's force (orange)."""
    every = max(1, round(run.replay_speed))
    time = run.signals["time"][::every] / run.replay_speed
    true = run.wall.fulcrum.p[::every]
    believed = run.wrist.pivot.p[::every]
    for path, points, radius, rgba in (
        ("true_fulcrum", true, 0.013, (0.16, 0.7, 0.3, 0.4)),
        ("believed_fulcrum", believed, 0.008, (0.6, 0.15, 0.8, 1.0)),
    ):
        draw_point(meshcat, animation, path, time, points, radius, rgba)
    draw_arrow(
        meshcat,
        animation,
        "wall_force",
        time,
        true,
        run.wall.force.f[::every] * METRES_PER_NEWTON,
        (0.95, 0.6, 0.1, 1.0),
        step=4,
    )
