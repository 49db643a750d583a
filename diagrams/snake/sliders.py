"""The snake in Meshcat without a simulation, to be bent by sliders."""

from time import monotonic, sleep
from typing import Any

import numpy as np
from pydrake.geometry import Cylinder, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.snake.wire_replay import draw_wires, put
from plants.snake.actuation import wire_lengths
from plants.snake.balls import turns_of
from plants.snake.kinematics import centreline
from plants.snake.looks import BRASS, PLATE, SWEPT
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array, posture_of
from systems.common.parameter import check


def show_snake(meshcat: Any, x: Array, params: SnakeParams | None = None) -> Array:
    """Draws balls, plates, tool and wires of a posture.

    Args:
        meshcat: Where to draw.
        x: Posture, (7,).
        params: The snake.

    Returns:
        Lengths of wires 0 to 8 in m, (9,).
    """
    params = check(params or SnakeParams())
    points = centreline(x, params)
    plate = Cylinder(params.body_radius, params.plate_thickness)
    for i in range(7):
        # A plate stands h past each ball, and one h before the first.
        axis = points[i] - points[i - 1] if i else np.array([0.0, 0.0, 1.0])
        R_WP = RotationMatrix.MakeFromOneVector(axis, 2)
        middle = points[i] - params.half_pitch * R_WP.col(2)
        X_WP = RigidTransform(R_WP, middle)
        put(meshcat, f"snake/plate{i}", plate, Rgba(*PLATE), X_WP)
        if i < 6:
            ball = Sphere(params.ball_radius)
            X_WB = RigidTransform(points[i])
            put(meshcat, f"snake/ball{i}", ball, Rgba(*BRASS), X_WB)
    if params.tool_radius > 0.0:
        tool, X_WT = Sphere(params.tool_radius), RigidTransform(points[7])
        put(meshcat, "snake/tool", tool, Rgba(*SWEPT), X_WT)
    draw_wires(meshcat, "snake/wires", turns_of(x), x[0], params)
    return wire_lengths(x, params)


def bend_with_sliders(
    meshcat: Any, seconds: float = 0.0, params: SnakeParams | None = None
) -> Array:
    """Lets Meshcat's sliders bend all three modules for some time.

    Args:
        meshcat: Where to draw; its controls get two sliders a module.
        seconds: How long; 0 draws the sliders' postures once.
        params: The snake.

    Returns:
        The last posture, (7,).
    """
    params = check(params or SnakeParams())
    limits = {"alpha": (-np.pi, np.pi), "beta": (0.0, params.max_bend)}
    sliders = [f"{angle}{k}" for k in (1, 2, 3) for angle in limits]
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetCameraPose([0.060, -0.068, 0.048], [0.0, 0.0, 0.020])
    start = {"alpha": 0.0, "beta": 0.3}
    for name in sliders:
        low, high = limits[name[:-1]]
        meshcat.AddSlider(name, low, high, 0.01, start[name[:-1]])
    end = monotonic() + seconds
    while True:
        bends = [meshcat.GetSliderValue(name) for name in sliders]
        x = posture_of([0.0, *bends])
        show_snake(meshcat, x, params)
        if monotonic() >= end:
            break
        sleep(0.05)
    for name in sliders:
        meshcat.DeleteSlider(name)
    return x
