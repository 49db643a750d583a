"""Trocar drift: how fast the trocars of R and of the tools move, by where they were."""

from math import exp
from typing import Any

import numpy as np

from systems.bypass.shadow_body import read_tool
from systems.common.compiled import compiled
from systems.common.geometry import along, limited, norm, over, sub, xyz
from systems.common.signal import Vector

_JUMP = 0.005
"""No trocar moves so far in a step, m."""
_FASTEST_TROCAR = 0.03
"""Nor so fast, m/s."""


@compiled
def trocar_drift(
    params: Any, places: np.ndarray, g: Vector, tools: np.ndarray
) -> np.ndarray:
    """Where the trocars are and how fast they move, smoothed: rows of six, m and m/s.

    Args:
        params: A record of `constants`.
        places: The same of the last step, R's first; as many as tools and one, or more.
        g: Fulcrum G_R, m.
        tools: Rows of `ObstacleTool`.
    """
    share, after = 1.0 - exp(-params.period / params.drift_time), places.copy()
    for i in range(1 + len(tools)):
        place = g if i == 0 else read_tool(tools[i - 1]).fulcrum
        before, v = xyz(places[i], 0), xyz(places[i], 3)
        way = sub(place, before)
        if norm(way) > _JUMP:  # another tool, or the first of it
            v = (0.0, 0.0, 0.0)
        else:
            v = along(v, share, sub(over(way, params.period), v))
        after[i, 0], after[i, 1], after[i, 2] = place
        after[i, 3], after[i, 4], after[i, 5] = limited(v, _FASTEST_TROCAR)
    return after
