"""The tools that R must not touch: O, S's own shaft, the endoscope.

S is where R has to go, so its last part is left out: as much as the final pose itself
comes nearer to than the distance that is planned with. What is left of S is an obstacle
like any other.
"""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np

from systems.bypass.shadow_body import (
    COLUMNS,
    FULCRUM,
    PLAN,
    SAFE,
    TIP,
    VELOCITY,
)
from systems.common.compiled import Numbers, compiled, packed
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
from systems.common.signals import fulcrum, usable, velocity

_LEAST_SINE = 0.15
"""Of the angle between S and R at the hand-over: no more of S is left out than this."""
_CLEAR = 0.001
"""Beyond the distance that is planned with, m."""


@dataclass
class Margins:
    """How far R keeps from the tools: distances of the axes; instruments touch at 5 mm.

    Attributes:
        safe_distance: D_safe, that the clearance constraint holds, m.
        plan_distance: D, that ways are planned with, m.
        target_distance: D_safe of S's own shaft, m.
        camera_distance: D_safe of the endoscope, which is twice as thick, m.
        avoid_target: Whether S's shaft is an obstacle.
        avoid_camera: Whether the endoscope is one.
        sigmas: Standard deviations of an estimate that are added to the distances.
        latency: From the tracker's exposure to the arm's motion, s; times sigma_v.
        most_margin: No more than this is added for an estimate, m.
    """

    safe_distance: float = 0.007
    plan_distance: float = 0.0095
    target_distance: float = 0.006
    camera_distance: float = 0.0095
    avoid_target: bool = True
    avoid_camera: bool = True
    sigmas: float = 3.0
    latency: float = 0.03
    most_margin: float = 0.004

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        for name, value in vars(self).items():
            if not 0.0 <= value < inf:
                raise ValueError(f"margins: {name}={value} must be finite and >= 0")
        if not 0.0 < self.safe_distance < self.plan_distance:
            raise ValueError(
                f"margins: plan_distance={self.plan_distance} m must be over "
                f"safe_distance={self.safe_distance} m, and both over 0"
            )


def constants(margins: Margins) -> np.ndarray:
    """The margins as the compiled functions take them.

    Raises:
        ValueError: If a margin is out of range.
    """
    margins.check()
    return packed(margins)


@compiled
def margin(margins: Any, estimate: Numbers) -> float:
    """What the estimate's own uncertainty adds to the distances, m."""
    late = margins.latency * estimate[13]
    sigma = sqrt(estimate[12] * estimate[12] + late * late)
    return min(margins.most_margin, margins.sigmas * sigma)


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
def set_row(row: np.ndarray, margins: Any, estimate: Numbers) -> None:
    """Writes an estimate (17) as a row (11) of obstacle tools, with its margin."""
    extra = margin(margins, estimate)
    for i in range(6):
        row[i] = estimate[i]
    for i in range(3):
        row[FULCRUM + i] = estimate[9 + i]
    row[SAFE] = margins.safe_distance + extra
    row[PLAN] = margins.plan_distance + extra


@compiled
def tool_rows(margins: Any, estimates: np.ndarray) -> np.ndarray:
    """Obstacle tools (n, 11) of estimates (n, 17)."""
    rows = np.empty((len(estimates), COLUMNS))
    for i in range(len(estimates)):
        set_row(rows[i], margins, estimates[i])
    return rows


@compiled
def obstacle_tools(
    margins: Any, g: Vector, obstacle: Numbers, target: Numbers, camera: Numbers
) -> np.ndarray:
    """The obstacle tools (n, 11), O first; see `shadow_body` for the columns.

    Args:
        margins: A record of `constants`.
        g: Fulcrum G_R, m.
        obstacle: Estimate (17) of O, usable.
        target: Estimate (17) of S, usable.
        camera: Estimate (17) of the endoscope.
    """
    rows = np.empty((3, COLUMNS))
    set_row(rows[0], margins, obstacle)
    count = 1
    if margins.avoid_target:
        g_s, p_s = fulcrum(target), xyz(target, 0)
        shaft = sub(p_s, g_s)
        length = norm(shaft)
        spared = spared_length(g, p_s, g_s, margins.plan_distance + _CLEAR)
        if spared < 0.95 * length:
            row, o = rows[count], unit(shaft)
            set_row(row, margins, target)
            end = along(p_s, -spared, o)
            v = shaft_point_velocity(1.0 - spared / length, o, velocity(target))
            for i in range(3):
                row[TIP + i], row[VELOCITY + i] = end[i], v[i]
            row[SAFE] += margins.target_distance - margins.safe_distance
            count += 1
    if margins.avoid_camera and usable(camera):
        set_row(rows[count], margins, camera)
        thicker = margins.camera_distance - margins.safe_distance
        rows[count, SAFE] += thicker
        rows[count, PLAN] += thicker
        count += 1
    return rows[:count]
