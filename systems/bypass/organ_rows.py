"""The hard clearance to organs: rows for the constraint, beside those of the tools.

With the distance d of a point of the shaft at the proportion s, its gradient n and the
organ's own velocity v_T, as for a tool (`safe_velocity`)

    A . v >= n . v_T - gamma (d - D),    A = s n + (1 - s) (n . u) u,

for every place where the distance along the shaft is least within its neighbourhood.
At the tip the gradients a little beside it count as well, taken back to it: these are
the walls of a valley that the tip is about to enter.
"""

from typing import Any

import numpy as np

from plants.organs.distance import SAFE, Organs, distance, normal, velocity
from systems.bypass.distance_rate import DistanceRate, least_rate, leverage
from systems.common.compiled import compiled
from systems.common.geometry import along, dot, norm, over, set_row, sub
from systems.common.projection import greatest_rate
from systems.common.signal import Vector

_NEAR = 0.025
"""Farther from what is kept an organ has no row, m."""
_STEP = 0.003
"""Between samples along the shaft, and of the gradients beside the tip, m."""
_AT_TIP = 0.01
"""Within this room the walls about the tip count, m."""
_MOST = 24
"""Rows of an organ."""


@compiled
def _row(
    params: Any,
    u: Vector,
    turning: float,
    s: float,
    n: Vector,
    room: float,
    v_organ: Vector,
) -> tuple[Vector, float]:
    """A row and its bound, m/s."""
    A = leverage(s, n, u)
    rate = DistanceRate(room, s, A, dot(n, v_organ), n, 1.0)
    evasion = greatest_rate(A, u, params.max_speed, turning)
    return A, least_rate(params, rate, 0.0, evasion)


@compiled
def organ_rows(
    params: Any, organs: Organs, g: Vector, p: Vector, turning: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (m, 3) and their bounds in m/s (m) for the velocity of R's tip.

    Args:
        params: A record of `clearance_constraint.constants`.
        organs: The organs.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        turning: Greatest speed of the tip across the shaft, m/s.
    """
    shaft = sub(p, g)
    q = norm(shaft)
    u = over(shaft, q)
    count = len(organs.table)
    rows, bounds = np.empty((_MOST * count, 3)), np.empty(_MOST * count)
    last = 0
    for k in range(count):
        keep, v_organ, first = organs.table[k, SAFE], velocity(organs, k), last
        at_tip = distance(organs, k, p) - keep
        # Down from the tip; `here` is a least one if both its neighbours are farther.
        before, here, t = 1e9, at_tip, 0.0
        while t < q and last - first < _MOST - 8:
            step = max(_STEP, 0.4 * here)  # the farther, the less it can change
            after = 1e9
            if t + step < q:
                after = distance(organs, k, along(p, -t - step, u)) - keep
            if here < _NEAR and here <= before and here <= after:
                n = normal(organs, k, along(p, -t, u))
                A, bound = _row(params, u, turning, 1.0 - t / q, n, here, v_organ)
                set_row(rows, last, A)
                bounds[last] = bound
                last += 1
            before, here, t = here, after, t + step
        if at_tip > _AT_TIP:
            continue
        for axis in range(3):
            for side in (-_STEP, _STEP):
                off = (side * (axis == 0), side * (axis == 1), side * (axis == 2))
                beside = along(p, 1.0, off)
                n = normal(organs, k, beside)
                room = distance(organs, k, beside) - dot(n, off) - keep
                A, bound = _row(params, u, turning, 1.0, n, room, v_organ)
                set_row(rows, last, A)
                bounds[last] = bound
                last += 1
    return rows[:last], bounds[:last]
