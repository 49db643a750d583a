"""The tools that R must not touch: the obstacles, S's own shaft, the endoscope.

S is where R has to go, so its last part is left out: as much as the final pose itself
comes nearer to than the distance that is planned with. What is left of S is an obstacle
like any other.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from systems.bypass.shadow_body import ObstacleTool, write_tool
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, dot, norm, shaft_point_velocity, sub, unit
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Vector, size
from systems.common.signals import Estimate, read_estimate, usable

_LEAST_SINE = 0.15
"""Of the angle between S and R at the hand-over: no more of S is left out than this."""
_CLEAR = 0.001
"""Beyond the distance that is planned with, m."""


COLUMNS = size(ObstacleTool)


@dataclass
class Margins:
    """How far R keeps from the tools: distances of the axes; instruments touch at 5 mm.

    The distances grow with an estimate's uncertainty.
    """

    safe_distance: float = parameter(
        0.007,
        "D_safe, that is held",
        "m",
        least=0.005,
        most=0.03,
    )
    plan_distance: float = parameter(
        0.0095, "D, that ways are planned with", "m", least=0.005, most=0.05
    )
    target_distance: float = parameter(
        0.006, "D_safe of S's own shaft", "m", least=0.005, most=0.03
    )
    camera_distance: float = parameter(
        0.0095,
        "D_safe of the endoscope, which is twice as thick",
        "m",
        least=0.0075,
        most=0.05,
    )
    avoid_target: bool = parameter(True, "whether S's shaft is an obstacle")
    avoid_camera: bool = parameter(True, "whether the endoscope is one")
    sigmas: float = parameter(
        3.0,
        "of an estimate's standard deviations that are added",
        "1",
        least=0.0,
        most=10.0,
    )
    latency: float = parameter(
        0.03,
        "from the tracker's exposure to the arm's motion; times sigma_v",
        "s",
        least=0.0,
        most=0.5,
    )
    most_margin: float = parameter(
        0.004, "no more than this is added for an estimate", "m", least=0.0, most=0.02
    )

    def rules(self) -> Rules:
        """What must hold across the margins."""
        yield (
            self.safe_distance < self.plan_distance,
            "plan_distance",
            f"more than safe_distance={self.safe_distance} m",
        )


def constants(margins: Margins) -> np.ndarray:
    """The margins as the compiled functions take them."""
    check(margins)
    return packed(margins)


@compiled
def margin(margins: Any, estimate: Estimate) -> float:
    """What the estimate's own uncertainty adds to the distances, m."""
    late = margins.latency * estimate.sigma_v
    sigma = sqrt(estimate.sigma_p * estimate.sigma_p + late * late)
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
def tool_of(margins: Any, estimate: Estimate, thicker: float) -> ObstacleTool:
    """An estimated tool, `thicker` than an instrument by this, m, with its margin."""
    extra = margin(margins, estimate)
    return ObstacleTool(
        estimate.p,
        estimate.v,
        estimate.fulcrum,
        margins.safe_distance + extra + thicker,
        margins.plan_distance + extra + thicker,
    )


@compiled
def tool_rows(margins: Any, estimates: np.ndarray) -> np.ndarray:
    """Obstacle tools (n, 11) of estimates (n, 17)."""
    rows = np.empty((len(estimates), COLUMNS))
    for i in range(len(estimates)):
        write_tool(rows, i, tool_of(margins, read_estimate(estimates[i]), 0.0))
    return rows


@compiled
def target_shaft(
    margins: Any, g: Vector, target: Estimate
) -> tuple[bool, ObstacleTool]:
    """What is left of S as an obstacle for R under g, and whether anything is."""
    tool = tool_of(margins, target, 0.0)
    shaft = sub(target.p, target.fulcrum)
    length, o = norm(shaft), unit(shaft)
    distance = margins.plan_distance + _CLEAR
    spared = spared_length(g, target.p, target.fulcrum, distance)
    left = ObstacleTool(
        along(target.p, -spared, o),
        shaft_point_velocity(1.0 - spared / length, o, target.v),
        target.fulcrum,
        tool.safe + (margins.target_distance - margins.safe_distance),
        tool.plan,
    )
    return spared < 0.95 * length, left


@compiled
def obstacle_tools(
    margins: Any, g: Vector, obstacles: np.ndarray, target: Estimate, camera: Estimate
) -> np.ndarray:
    """The tools to keep clear of (m, 11), the obstacles first; see `ObstacleTool`.

    Args:
        margins: A record of `constants`.
        g: Fulcrum G_R, m.
        obstacles: Estimates (n, 17), usable.
        target: Of S.
        camera: Of the endoscope.
    """
    count = len(obstacles)
    rows = np.empty((count + 2, COLUMNS))
    rows[:count] = tool_rows(margins, obstacles)
    if margins.avoid_target and usable(target):
        is_left, shaft = target_shaft(margins, g, target)
        if is_left:
            write_tool(rows, count, shaft)
            count += 1
    if margins.avoid_camera and usable(camera):
        thicker = margins.camera_distance - margins.safe_distance
        write_tool(rows, count, tool_of(margins, camera, thicker))
        count += 1
    return rows[:count]
