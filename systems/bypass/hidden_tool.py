"""A tool out of sight: R withdraws along its own shaft before that tool can be there.

Of a tool that the tracker has not seen for a moment R knows where it should be, and
that it may come from any side, as fast as V_O. What R does across its shaft may be
towards it; withdrawing takes no new room inside the body. So R withdraws, as it does
from a tool that sweeps its shaft (`dodge`), while the room that is left,

    rho - V_O age - D_safe,

would be used up at V_O before R were out. Beside that it evades as long as the
estimate is known; then it stands. Tools that are seen count with what they do. It
goes no further out than it can turn about its trocar afterwards: with 10 mm inside an
arm that lags and a wall that breathes left 9 N on the wall.
"""

from math import sqrt
from typing import Any

import numpy as np

from systems.bypass.distance_rate import DistanceRate, distance_rate
from systems.bypass.dodge import must_dodge
from systems.bypass.shadow_body import read_tool
from systems.common.compiled import compiled
from systems.common.geometry import dot, norm, sub, unit
from systems.common.signal import Vector
from systems.common.signals import NEVER_SEEN, finite_estimate, read_estimate

_OVERDUE = 0.1
"""Age of the last frame beyond which a tool is out of sight [s]: six frames."""
_MORE = 0.02
"""What stays inside beyond the least insertion [m]: the arm lags by 8 mm at full
speed, and the wall breathes by 10."""


@compiled
def were_seen(obstacles: np.ndarray) -> bool:
    """Whether there is a place for every tool, be it where it was seen last."""
    all_were = True
    for i in range(len(obstacles)):
        one = read_estimate(obstacles[i])
        all_were = all_were and finite_estimate(one) and one.sigma_p < NEVER_SEEN
    return all_were


@compiled
def withdrawal(
    params: Any,
    workspace: Any,
    g: Vector,
    p: Vector,
    tools: np.ndarray,
    obstacles: np.ndarray,
) -> float:
    """How fast R, which does not see every tool, has to get out, m/s; 0: it need not.

    Args:
        params: A record of `clearance_constraint.constants`.
        workspace: A record of `workspace.constants`.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        tools: Rows of `ObstacleTool`, the obstacles first.
        obstacles: Their estimates (n, 17).
    """
    oldest = 0.0
    for i in range(len(obstacles)):
        oldest = max(oldest, read_estimate(obstacles[i]).age)
    shaft, withdraws = sub(p, g), False
    way = norm(shaft) - workspace.min_insertion - _MORE
    if oldest <= _OVERDUE or way <= 0.0:
        return 0.0
    u, q = unit(shaft), norm(shaft)
    for i in range(len(tools)):
        tool = read_tool(tools[i])
        rate = distance_rate(g, p, tool)
        if i < len(obstacles) and read_estimate(obstacles[i]).age > _OVERDUE:
            fastest = params.obstacle_speed
            rho = rate.rho - fastest * read_estimate(obstacles[i]).age
            rate = DistanceRate(rho, rate.s, rate.A, fastest, rate.n, rate.l_over_L)
        # Nothing that R could do across its shaft counts.
        outwards = dot(rate.A, u)
        if must_dodge(params, False, q, rate, tool.safe, outwards, 0.0, 0.0):
            withdraws = True
    braked = sqrt(params.acceleration * way)
    return min(params.max_speed, braked) if withdraws else 0.0
