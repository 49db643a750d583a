"""The tools that R must not touch: O, S's own shaft, the endoscope.

S is where R has to go, so its last part is left out: as much as the final pose itself
comes nearer to than the distance that is planned with. What is left of S is an obstacle
like any other.
"""

from math import sqrt
from typing import Any

import numpy as np

from systems.auto_guidance.shadow_body import (
    COLUMNS,
    FULCRUM,
    PLAN,
    SAFE,
    TIP,
    VELOCITY,
)
from systems.auto_guidance.signals import fulcrum, usable, velocity
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import (
    Vector,
    along,
    dot,
    norm,
    shaft_point_velocity,
    sub,
    unit,
    xyz,
)

_LEAST_SINE = 0.15
"""Of the angle between S and R at the hand-over: no more of S is left out than this."""
_CLEAR = 0.001
"""Beyond the distance that is planned with, m."""


@compiled
def margin(params: Any, estimate: Numbers) -> float:
    """What the estimate's own uncertainty adds to the distances, m."""
    late = params.latency * estimate[13]
    sigma = sqrt(estimate[12] * estimate[12] + late * late)
    return min(params.most_margin, params.sigmas * sigma)


@compiled
def spared_length(g: Vector, p_WS: Vector, g_s: Vector, distance: float) -> float:
    """How much of S is left out at its tip, m.

    Args:
        g: Fulcrum G_R, m.
        p_WS: S's tip, m.
        g_s: S's fulcrum, m.
        distance: Of the axes, which the final pose keeps from the rest, m.
    """
    o, u = unit(sub(g_s, p_WS)), unit(sub(g, p_WS))
    cosine = dot(o, u)
    if cosine <= 0.0:  # S comes from the other side: its tip is the nearest
        return distance
    return distance / max(_LEAST_SINE, sqrt(max(0.0, 1.0 - cosine * cosine)))


@compiled
def set_row(row: np.ndarray, params: Any, estimate: Numbers) -> None:
    """Writes an estimate (17) as a row (11) of obstacle tools, with its margin."""
    extra = margin(params, estimate)
    for i in range(6):
        row[i] = estimate[i]
    for i in range(3):
        row[FULCRUM + i] = estimate[9 + i]
    row[SAFE] = params.safe_distance + extra
    row[PLAN] = params.plan_distance + extra


@compiled
def tool_rows(params: Any, estimates: np.ndarray) -> np.ndarray:
    """Obstacle tools (n, 11) of estimates (n, 17)."""
    rows = np.empty((len(estimates), COLUMNS))
    for i in range(len(estimates)):
        set_row(rows[i], params, estimates[i])
    return rows


@compiled
def obstacle_tools(
    params: Any, g: Vector, obstacle: Numbers, target: Numbers, camera: Numbers
) -> np.ndarray:
    """The obstacle tools (n, 11), O first; see `shadow_body` for the columns.

    Args:
        params: A record with `safe_distance` and `plan_distance` of the axes, m,
            `target_distance`, that to S's shaft, and `avoid_target`, `avoid_camera`.
        g: Fulcrum G_R, m.
        obstacle: Estimate (17) of O, usable.
        target: Estimate (17) of S, usable.
        camera: Estimate (17) of the endoscope.
    """
    rows = np.empty((3, COLUMNS))
    set_row(rows[0], params, obstacle)
    count = 1
    if params.avoid_target:
        g_s, p_s = fulcrum(target), xyz(target, 0)
        shaft = sub(p_s, g_s)
        length = norm(shaft)
        spared = spared_length(g, p_s, g_s, params.plan_distance + _CLEAR)
        if spared < 0.95 * length:
            row, o = rows[count], unit(shaft)
            set_row(row, params, target)
            end = along(p_s, -spared, o)
            v = shaft_point_velocity(1.0 - spared / length, o, velocity(target))
            for i in range(3):
                row[TIP + i], row[VELOCITY + i] = end[i], v[i]
            row[SAFE] += params.target_distance - params.safe_distance
            count += 1
    if params.avoid_camera and usable(camera):
        set_row(rows[count], params, camera)
        count += 1
    return rows[:count]
