"""The wires in a recording: fixed pieces that follow the snake's posture."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.geometry import Capsule, Rgba, Shape
from pydrake.math import RigidTransform, RotationMatrix

from plants.snake.parameters import SnakeParams
from plants.snake.wire_path import hanging_points, tangent_points, wires_at

WIRE_RADIUS = 0.26e-3
COLORS = ((0.85, 0.20, 0.16, 1.0), (0.10, 0.55, 0.28, 1.0), (0.13, 0.35, 0.80, 1.0))
"""Wires of modules 1, 2 and 3."""


def wire_poses(
    turns: np.ndarray, s: float, params: SnakeParams
) -> dict[str, RigidTransform]:
    """Poses in W of all pieces of all wires, by name.

    Three pieces across each ball: one from either plate, one on the ball.

    Args:
        turns: R_i of the balls, (6, 3, 3).
        s: Translation in m.
        params: The snake.
    """
    poses = {}
    R = params.ball_radius
    for ball, (centre, P, P_far) in enumerate(hanging_points(turns, s, params)):
        B, C = tangent_points(centre, P, P_far, params)
        off = (B + C) / 2 - centre
        far = np.linalg.norm(off, axis=1)[:, None]
        # On the ball the middle piece is a chord: half of its rise outwards.
        middle = centre + off * (1 + np.maximum(R - far, 0.0) / (2 * far))
        rows = zip(wires_at(ball), P, B, C, P_far, middle, strict=True)
        for wire, p, b, c, p_far, m in rows:
            for name, along, at in (
                ("near", b - p, (p + b) / 2),
                ("far", c - p_far, (p_far + c) / 2),
                ("middle", p_far - p, m),
            ):
                R_WG = RotationMatrix.MakeFromOneVector(along, 2)
                poses[f"wire{wire}/ball{ball}_{name}"] = RigidTransform(R_WG, at)
    return poses


def put(
    meshcat: Any, path: str, shape: Shape, rgba: Rgba, X_WG: RigidTransform
) -> None:
    """Draws a shape; one that is there is only moved, which a browser does fast."""
    if not meshcat.HasPath(path):
        meshcat.SetObject(path, shape, rgba)
    meshcat.SetTransform(path, X_WG)


def draw_wires(
    meshcat: Any, path: str, turns: np.ndarray, s: float, params: SnakeParams
) -> None:
    """Draws the wires over balls that turn by R_i (6, 3, 3)."""
    chord = 2 * params.ball_radius * np.sin(params.max_bend / 2)
    for name, X_WG in wire_poses(turns, s, params).items():
        length = chord if name.endswith("middle") else params.face
        color = Rgba(*COLORS[int(name[4]) // 3])
        put(meshcat, f"{path}/{name}", Capsule(WIRE_RADIUS, length), color, X_WG)


def animate_wires(
    meshcat: Any,
    animation: Any,
    path: str,
    times: np.ndarray,
    turns: np.ndarray,
    s: np.ndarray,
    params: SnakeParams,
    broken: Mapping[int, float] | None = None,
) -> None:
    """Draws the wires into a recording.

    Args:
        meshcat: The Meshcat that records.
        animation: Its recording.
        path: Meshcat path.
        times: Key frames [s], (n,).
        turns: R_i of the balls there, (n, 6, 3, 3).
        s: Translation there in m, (n,).
        params: The snake.
        broken: When wires snapped [s]: they vanish.
    """
    draw_wires(meshcat, path, turns[0], s[0], params)
    for time, balls, height in zip(times, turns, s, strict=True):
        frame = animation.frame(time)
        for name, X_WG in wire_poses(balls, height, params).items():
            animation.SetTransform(frame, f"{path}/{name}", X_WG)
    for wire, time in (broken or {}).items():
        animation.SetProperty(0, f"{path}/wire{wire}", "visible", True)
        frame = animation.frame(time)
        animation.SetProperty(frame, f"{path}/wire{wire}", "visible", False)
