"""What surrounds the scene, for the eye only: table, organs and the arm's stand."""

from collections.abc import Sequence
from typing import Any

from pydrake.geometry import Box, Cylinder, Ellipsoid
from pydrake.math import RigidTransform, RollPitchYaw

from plants.common.looks import DRAPE, GALL, LIVER, PEDESTAL, TISSUE, draw

FLOOR = -0.85
"""Height of the floor in the world, in m."""


def add_scenery(plant: Any, p_WB: Sequence[float], organs: bool = True) -> None:
    """Draws a draped table, tissue, liver and a stand under the arm.

    Args:
        plant: A MultibodyPlant that is not yet finalized, with a SceneGraph.
        p_WB: Position of the arm's base in the world, in m (3).
        organs: Whether liver and gallbladder are drawn; false if there are real ones.
    """
    body = plant.world_body()
    for name, shape, p, yaw, rgba in (
        ("table", Box(0.56, 1.30, 0.06), [0.0, 0.0, -0.27], 0.0, DRAPE),
        ("table_foot", Box(0.30, 0.50, 0.55), [0.0, 0.0, -0.575], 0.0, PEDESTAL),
        ("tissue", Ellipsoid(0.215, 0.274, 0.036), [0.0, 0.0, -0.240], 0.0, TISSUE),
        ("liver", Ellipsoid(0.075, 0.11, 0.034), [0.05, 0.12, -0.208], 0.4, LIVER),
        ("gall", Ellipsoid(0.030, 0.015, 0.014), [0.02, 0.015, -0.200], 0.9, GALL),
    ):
        if name in ("liver", "gall") and not organs:
            continue
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
