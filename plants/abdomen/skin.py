"""The look of the abdomen: a translucent, inflated belly."""

from collections.abc import Sequence
import math
from typing import Any

from pydrake.math import RigidTransform

from plants.common.lathe import lathe
from plants.common.looks import SKIN, draw

HALF_WIDTH, HALF_LENGTH, HEIGHT = 0.22, 0.28, 0.24
"""Half axes of the belly along x and y, and its height, in m."""

_MAST = 1.0
"""Height of an invisible mast on the mesh, in m. Browsers draw translucent things from
far to near by the middles of their boxes: seen from above, the skin so comes last,
and what is translucent inside it (the view cone) is not lost."""


def belly_profile(rings: int = 24) -> list[tuple[float, float]]:
    """A dome with a flat top and round sides: (z / HEIGHT + 1)^2 + r^4 = 1.

    It is within 4 mm of the plane z = 0 for r < 0.4 (some 90 mm), where the trocars
    stand.

    Returns:
        Points (r, z), r from 0 to 1 and z from 0 to -HEIGHT in m.
    """
    slopes = [0.5 * math.pi * i / rings for i in range(rings + 1)]
    return [
        (math.sqrt(math.sin(slope)), HEIGHT * (math.cos(slope) - 1.0))
        for slope in slopes
    ]


def draw_skin(plant: Any, wall: Any, p_PG: Sequence[float]) -> None:
    """Draws the belly on the wall's body, its top at the parent's origin."""
    profile = [(0.0, _MAST), (0.0, 0.0), *belly_profile()]
    belly = lathe(profile, "belly", (HALF_WIDTH, HALF_LENGTH))
    draw(plant, wall, belly, RigidTransform([-x for x in p_PG]), "skin", SKIN)
