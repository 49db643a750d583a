"""Where R waits while an obstacle tool stands on the target's own line.

The final pose lies in a shadow body then. The nearest free poses are at its three
borders: on the target's line in front of the tool, to either side of its slab, and past
its tip. Of those that are free of all tools and within the workspace the best is near
the target, and a little near to R; one that R cannot go to straight counts as farther.
"""

from math import asin, cos, isfinite, sin
from typing import Any

import numpy as np

from systems.bypass.shadow_body import (
    ObstacleTool,
    free_depth,
    pose_distance,
    read_tool,
    way_distance,
)
from systems.bypass.workspace import is_inside
from systems.common.compiled import compiled
from systems.common.geometry import (
    across,
    along,
    any_perpendicular,
    cross,
    norm,
    plus,
    row_of,
    scaled,
    set_row,
    sub,
    unit,
)
from systems.common.signal import Vector
from systems.common.signals import ViewCone

_NEARNESS = 0.3
"""What the distance from R counts, against that from the target."""
_DETOUR = 0.025
"""What a pose that R cannot go to straight counts more, m."""
_HALVINGS = 16


@compiled
def turned(u: Vector, n: Vector, angle: float) -> Vector:
    """The unit vector u turned by `angle` towards the unit vector n across it."""
    return plus(scaled(cos(angle), u), scaled(sin(angle), n))


@compiled
def least_turn(
    tool: ObstacleTool,
    g: Vector,
    u: Vector,
    n: Vector,
    depth: float,
    distance: float,
) -> float:
    """The least angle from u towards n at which `depth` is free, up to 1.5 rad.

    Args:
        tool: The obstacle tool.
        g: Fulcrum G_R, m.
        u: A direction in the tool's shadow, unit vector.
        n: Where to turn it to, a unit vector across u.
        depth: Insertion, m.
        distance: D of the axes to keep, m.
    """
    low, high = 0.0, 1.5
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if free_depth(g, turned(u, n, middle), tool, distance) > depth:
            high = middle
        else:
            low = middle
    return high


@compiled
def waiting_pose(
    params: Any,
    workspace: Any,
    view_cone: ViewCone,
    g: Vector,
    p: Vector,
    goal: Vector,
    tools: np.ndarray,
    in_use: int,
) -> tuple[Vector, int]:
    """The pose (R's tip) to wait in, m, and its number.

    Args:
        params: A record of `tool_bypass.constants`.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, in the shadow of a tool or several, m.
        tools: Rows of `ObstacleTool`.
        in_use: Number of the pose in use, 0 if none. It is kept until another is
            better by `switch_gain`, so that noise does not make R change its mind.
    """
    count = len(tools)
    shaft = sub(goal, g)
    depth, u = norm(shaft), unit(shaft)
    poses = np.full((1 + 3 * count, 3), np.nan)
    # (i) In front of every tool.
    first = depth
    for i in range(count):
        tool = read_tool(tools[i])
        keep = tool.safe + params.waiting_room
        first = min(first, free_depth(g, u, tool, keep) - 1e-6)
    set_row(poses, 0, along(g, first, u))
    for i in range(count):
        tool = read_tool(tools[i])
        keep = tool.safe + params.waiting_room
        if pose_distance(tool, g, goal) >= keep:
            continue
        # (ii) To either side of the slab through G, G_O and P_O, (iii) past the tip.
        to_tip = sub(tool.tip, g)
        n = unit(cross(sub(tool.fulcrum, g), to_tip), any_perpendicular(u))
        n = unit(across(n, u), any_perpendicular(u))
        beyond = unit(across(to_tip, u), any_perpendicular(u))
        off = asin(min(1.0, norm(cross(to_tip, u)) / max(norm(to_tip), 1e-9)))
        ways = (n, scaled(-1.0, n), beyond)
        for k in range(3):
            way, start = ways[k], u
            if k == 2:  # from O's tip on, where the free depths begin again
                start = turned(u, way, off)
                way = unit(across(way, start), n)
            angle = least_turn(tool, g, start, way, depth, keep)
            set_row(poses, 1 + 3 * i + k, along(g, depth, turned(start, way, angle)))
    best, number, least = plus(g, sub(p, g)), len(poses) + 1, 1e9
    for k in range(len(poses)):
        pose = row_of(poses, k)
        if not isfinite(pose[0]) or not is_inside(workspace, view_cone, g, pose):
            continue
        is_kept = k + 1 == in_use
        cost = norm(sub(pose, goal)) + _NEARNESS * norm(sub(pose, p))
        room = params.waiting_room
        slack = -room if is_kept else 0.8 * room
        for i in range(count):
            tool = read_tool(tools[i])
            if pose_distance(tool, g, pose) < tool.safe + slack:
                cost = 1e9
            elif not is_kept and way_distance(tool, g, p, pose) < tool.safe:
                cost += _DETOUR
        if is_kept and cost < 1e8:
            cost -= params.switch_gain
        if cost < least:
            best, number, least = pose, k + 1, cost
    return best, number
