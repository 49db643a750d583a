"""What the snake looks like: balls and plates as in the paper's Figure 3."""

import math
from typing import Any

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from plants.common.looks import DARK, STEEL, draw
from plants.snake.parameters import SnakeParams

BRASS = [0.80, 0.66, 0.36, 1.0]
PLATE = [0.62, 0.66, 0.71, 1.0]
SWEPT = [0.95, 0.55, 0.15, 0.28]
CHANNEL = [0.55, 0.70, 0.85, 0.18]

SHANK_RADIUS = 0.8e-3
CHANNEL_LENGTH = 0.03
ROD = 0.2


def _along(z: float) -> RigidTransform:
    return RigidTransform([0.0, 0.0, z])


def draw_ball(plant: Any, body: Any, params: SnakeParams) -> None:
    """One drilled ball at the body's origin."""
    draw(plant, body, Sphere(params.ball_radius), _along(0), "ball", BRASS)


def draw_plate(plant: Any, body: Any, params: SnakeParams) -> None:
    """One plate, h past the ball centre at the body's origin."""
    disc = Cylinder(params.body_radius, params.plate_thickness)
    draw(plant, body, disc, _along(params.half_pitch), "plate", PLATE)


def draw_carriage(plant: Any, body: Any, params: SnakeParams, rod: bool) -> None:
    """The base plate before O0, and the tube and slide, or the rod, that carry it."""
    h, e, r = params.half_pitch, params.plate_thickness, params.body_radius
    draw(plant, body, Cylinder(r, e), _along(-h), "base_plate", PLATE)
    if rod:
        X = _along(-h - 0.5 * (e + ROD))
        draw(plant, body, Cylinder(0.75 * r, ROD), X, "rod", DARK)
        return
    tube = 0.06
    draw(plant, body, Cylinder(r, tube), _along(-h - 0.5 * (e + tube)), "tube", STEEL)
    foot = -h - e - tube
    draw(plant, body, Cylinder(2.2 * r, 0.02), _along(foot), "motor", DARK)
    draw(plant, body, Box(0.03, 0.03, 0.01), _along(foot - 0.01), "slide", DARK)


def draw_tool(plant: Any, body: Any, params: SnakeParams) -> None:
    """The wire ring, the ball that it sweeps, and its shank. Origin: its centre."""
    r = params.tool_radius
    if r <= 0.0:
        return
    # From the last plate's outer face to the ring.
    reach = params.half_pitch - params.plate_thickness / 2 + params.tool_offset
    shank = max(reach - r, 1e-4)
    draw(
        plant,
        body,
        Cylinder(SHANK_RADIUS, shank),
        _along(-reach + 0.5 * shank),
        "shank",
        DARK,
    )
    pieces = 20
    for i in range(pieces):
        angle = 2 * math.pi * (i + 0.5) / pieces
        p = r * np.array([math.cos(angle), 0.0, math.sin(angle)])
        tangent = np.array([-math.sin(angle), 0.0, math.cos(angle)])
        X = RigidTransform(RotationMatrix.MakeFromOneVector(tangent, 2), p)
        chord = 2 * math.pi * r / pieces
        draw(plant, body, Capsule(0.25e-3, chord), X, f"ring{i}", DARK)
    draw(plant, body, Sphere(r), _along(0), "swept", SWEPT)


def draw_channel(plant: Any, frame_body: Any, radius: float) -> None:
    """The access channel, along -z from the body origin.."""
    draw(
        plant,
        frame_body,
        Cylinder(radius, CHANNEL_LENGTH),
        _along(-0.5 * CHANNEL_LENGTH),
        "channel",
        CHANNEL,
    )
