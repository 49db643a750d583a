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
    FULCRUM,
    SAFE,
    TIP,
    free_depth,
    pose_distance,
    way_distance,
)
from systems.bypass.workspace import is_inside
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import (
    Vector,
    along,
    any_perpendicular,
    cross,
    dot,
    norm,
    sub,
    unit,
    xyz,
)

_NEARNESS = 0.3
"""What the distance from R counts, against that from the target."""
_DETOUR = 0.025
"""What a pose that R cannot go to straight counts more, m."""
_HALVINGS = 16


@compiled
def turned(u: Vector, n: Vector, angle: float) -> Vector:
    """The unit vector u turned by `angle` towards the unit vector n across it."""
    scaled = (cos(angle) * u[0], cos(angle) * u[1], cos(angle) * u[2])
    return along(scaled, sin(angle), n)


@compiled
def least_turn(
    tool: np.ndarray, g: Vector, u: Vector, n: Vector, depth: float, distance: float
) -> float:
    """The least angle from u towards n at which `depth` is free, up to 1.5 rad.

    Args:
        tool: A row of obstacle tools.
        g: Fulcrum G_R, m.
        u: A direction in the tool's shadow, unit vector.
        n: Where to turn it to, a unit vector across u.
        depth: Insertion, m.
        distance: D of the axes to keep, m.
    """
    a, p_o = xyz(tool, FULCRUM), xyz(tool, TIP)
    low, high = 0.0, 1.5
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if free_depth(g, turned(u, n, middle), a, p_o, distance) > depth:
            high = middle
        else:
            low = middle
    return high


@compiled
def waiting_pose(
    params: Any,
    workspace: Any,
    view_cone: Numbers,
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
        view_cone: Apex, axis, half angle (7).
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, in the shadow of a tool or several, m.
        tools: Obstacle tools (n, 11).
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
        tool = tools[i]
        keep = tool[SAFE] + params.waiting_room
        a, p_o = xyz(tool, FULCRUM), xyz(tool, TIP)
        first = min(first, free_depth(g, u, a, p_o, keep) - 1e-6)
    pose = along(g, first, u)
    for axis in range(3):
        poses[0, axis] = pose[axis]
    for i in range(count):
        tool = tools[i]
        keep = tool[SAFE] + params.waiting_room
        if pose_distance(tool, g, goal) >= keep:
            continue
        # (ii) To either side of the slab through G, G_O and P_O, (iii) past the tip.
        a, p_o = xyz(tool, FULCRUM), xyz(tool, TIP)
        n = unit(cross(sub(a, g), sub(p_o, g)), any_perpendicular(u))
        n = unit(along(n, -dot(n, u), u), any_perpendicular(u))
        to_tip = sub(p_o, g)
        beyond = unit(along(to_tip, -dot(to_tip, u), u), any_perpendicular(u))
        off = asin(min(1.0, norm(cross(to_tip, u)) / max(norm(to_tip), 1e-9)))
        ways = (n, (-n[0], -n[1], -n[2]), beyond)
        for k in range(3):
            way, start = ways[k], u
            if k == 2:  # from O's tip on, where the free depths begin again
                start = turned(u, way, off)
                way = unit(along(way, -dot(way, start), start), n)
            angle = least_turn(tool, g, start, way, depth, keep)
            pose = along(g, depth, turned(start, way, angle))
            for axis in range(3):
                poses[1 + 3 * i + k, axis] = pose[axis]
    best, number, least = along(g, 1.0, sub(p, g)), len(poses) + 1, 1e9
    for k in range(len(poses)):
        pose = xyz(poses[k], 0)
        if not isfinite(pose[0]) or not is_inside(workspace, view_cone, g, pose):
            continue
        is_kept = k + 1 == in_use
        cost = norm(sub(pose, goal)) + _NEARNESS * norm(sub(pose, p))
        room = params.waiting_room
        slack = -room if is_kept else 0.8 * room
        for i in range(count):
            if pose_distance(tools[i], g, pose) < tools[i, SAFE] + slack:
                cost = 1e9
            elif not is_kept and way_distance(tools[i], g, p, pose) < tools[i, SAFE]:
                cost += _DETOUR
        if is_kept and cost < 1e8:
            cost -= params.switch_gain
        if cost < least:
            best, number, least = pose, k + 1, cost
    return best, number
