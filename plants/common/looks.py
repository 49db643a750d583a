"""Colours of everything that a person sees, and how shapes get them."""

from typing import Any

from pydrake.geometry import GeometryInstance, MakePhongIllustrationProperties, Shape
from pydrake.math import RigidTransform

STEEL = [0.72, 0.74, 0.77, 1.0]
DARK = [0.16, 0.17, 0.19, 1.0]
GAUZE = [0.98, 0.97, 0.93, 1.0]
SKIN = [0.91, 0.71, 0.60, 0.30]
TROCAR = [0.22, 0.36, 0.60, 1.0]
GREEN = [0.20, 0.66, 0.36, 1.0]
RED = [0.84, 0.25, 0.20, 1.0]
VIEW = [1.0, 0.84, 0.20, 0.40]
LIVER = [0.50, 0.22, 0.18, 1.0]
GALL = [0.35, 0.47, 0.25, 1.0]
STOMACH = [0.80, 0.48, 0.42, 1.0]
BOWEL = [0.84, 0.58, 0.46, 1.0]
TISSUE = [0.86, 0.56, 0.50, 1.0]
DRAPE = [0.24, 0.50, 0.53, 1.0]
PEDESTAL = [0.45, 0.47, 0.50, 1.0]


def illustration(
    shape: Shape, X_FG: RigidTransform, name: str, rgba: list[float]
) -> GeometryInstance:
    """A geometry that is seen and never touched.

    Args:
        shape: What to draw.
        X_FG: Its pose in the frame that it will hang on.
        name: Unique among the frame's geometries.
        rgba: Colour and opacity.
    """
    instance = GeometryInstance(X_FG, shape, name)
    instance.set_illustration_properties(MakePhongIllustrationProperties(rgba))
    return instance


def draw(
    plant: Any,
    body: Any,
    shape: Shape,
    X_BG: RigidTransform,
    name: str,
    rgba: list[float],
) -> None:
    """Draws a shape on a plant's body, if the plant has a SceneGraph."""
    if plant.geometry_source_is_registered():
        plant.RegisterVisualGeometry(body, X_BG, shape, name, rgba)
