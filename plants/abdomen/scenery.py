"""What surrounds the scene, for the eye only: table, organs and the arm's stand."""

from collections.abc import Sequence
from typing import Any

from pydrake.geometry import Box, Cylinder, Ellipsoid
from pydrake.math import RigidTransform, RollPitchYaw

from plants.common.looks import BOWEL, DRAPE, LIVER, PEDESTAL, draw

FLOOR = -0.85
"""Height of the floor in the world, in m."""


def add_scenery(plant: Any, p_WB: Sequence[float]) -> None:
    """Draws a draped table, a few organs and a stand under the arm.

    Args:
        plant: A MultibodyPlant that is not yet finalized, with a SceneGraph.
        p_WB: Position of the arm's base in the world, in m (3).
    """
    body = plant.world_body()
    for name, shape, p, yaw, rgba in (
        ("table", Box(0.56, 1.30, 0.06), [0.0, 0.0, -0.27], 0.0, DRAPE),
        ("table_foot", Box(0.30, 0.50, 0.55), [0.0, 0.0, -0.575], 0.0, PEDESTAL),
        ("liver", Ellipsoid(0.075, 0.10, 0.035), [0.03, 0.13, -0.205], 0.4, LIVER),
        ("bowel_1", Ellipsoid(0.11, 0.035, 0.028), [0.0, 0.02, -0.212], 0.2, BOWEL),
        ("bowel_2", Ellipsoid(0.11, 0.035, 0.028), [0.01, -0.05, -0.212], -0.1, BOWEL),
        ("bowel_3", Ellipsoid(0.10, 0.035, 0.028), [-0.01, -0.12, -0.212], 0.15, BOWEL),
    ):
        draw(
            plant,
            body,
            shape,
            RigidTransform(RollPitchYaw(0.0, 0.0, yaw), p),
            name,
            rgba,
        )
    height = p_WB[2] - FLOOR
    draw(
        plant,
        body,
        Cylinder(0.10, height),
        RigidTransform([p_WB[0], p_WB[1], FLOOR + 0.5 * height]),
        "stand",
        PEDESTAL,
    )
    draw(
        plant,
        body,
        Cylinder(0.22, 0.03),
        RigidTransform([p_WB[0], p_WB[1], FLOOR + 0.015]),
        "stand_foot",
        PEDESTAL,
    )
