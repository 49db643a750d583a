"""Which obstacle tool is the paper's O where there are several: the nearest to R.

With one it is that one. One that cannot be used comes before all others: R must not
move as if it were not there, so every behaviour does what it does without O.
"""

from math import inf

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import closest_points
from systems.common.signal import Vector
from systems.common.signals import Estimate, Guide, RobotTool, read_estimate, usable


@compiled
def nearest_obstacle(robot: RobotTool, obstacles: np.ndarray) -> Estimate:
    """O of the estimates (n, 17): the one whose axis is nearest to R's."""
    return _nearest(robot.fulcrum, robot.tip, obstacles)


@compiled
def obstacle_at(guide: Guide, obstacles: np.ndarray) -> Estimate:
    """O of the estimates (n, 17): the one whose axis M_O lies on."""
    return _nearest(guide.M_O, guide.M_O, obstacles)


@compiled
def _nearest(a: Vector, b: Vector, obstacles: np.ndarray) -> Estimate:
    """The unusable obstacle, or the one nearest to the segment a->b; the first of two.

    Where a or b is not a number, it is the first.
    """
    chosen, least = 0, inf
    if len(obstacles) > 1:
        for i in range(len(obstacles)):
            tool = read_estimate(obstacles[i])
            if not usable(tool):
                return tool
            distance = closest_points(a, b, tool.fulcrum, tool.p).distance
            if distance < least:
                chosen, least = i, distance
    return read_estimate(obstacles[chosen])
