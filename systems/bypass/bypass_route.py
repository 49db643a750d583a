"""Which way R's tip goes: straight, over an edge, or up and over everything.

One potential at a time. While the straight motion is free of all tools: attraction.
Else the way over the shorter of the edges of the tools that are across, kept until
another is clearly shorter. With several tools a way counts only if its two legs, to the
edge and from there to the goal, are free of the others.

Where no edge will do: the deepest point of the goal's own line that the tip can go to
straight; if there is none, retract. The free set is star-shaped about G_R, so the
triangle to a shallower point is never nearer to a tool, the point gets deeper as R
follows, and retracting always opens it: a retract, turn, insert that cuts the corners,
complete for any number of standing tools that leave the room q_min + D at G_R.
"""

from typing import Any

import numpy as np

from systems.bypass.shadow_body import (
    FULCRUM,
    PLAN,
    SAFE,
    TIP,
    pose_distance,
    way_distance,
)
from systems.bypass.tip_edge import tip_edge
from systems.bypass.top_edge import top_edge
from systems.bypass.waiting_pose import waiting_pose
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, norm, sub, unit, xyz

STRAIGHT = 0
OVER = -1
"""Up and over everything; edges: 1 and 2 (top and tip) of tool 0, 3 and 4 of 1 ..."""

_SLACK = 1e-4
"""How much nearer to a tool than now a leg may lead where R is near already, m."""
_HALVINGS = 12

type Choice = tuple[Vector, float, int, int, Vector]


@compiled
def is_free(
    tools: np.ndarray,
    keep: np.ndarray,
    but: int,
    g: Vector,
    p: Vector,
    goal: Vector,
) -> bool:
    """Whether the straight motion keeps its distances; the tool `but` is left out."""
    for i in range(len(tools)):
        if i != but and way_distance(tools[i], g, p, goal) < keep[i]:
            return False
    return True


@compiled
def up_and_over(
    tools: np.ndarray,
    keep: np.ndarray,
    q_min: float,
    g: Vector,
    p: Vector,
    goal: Vector,
) -> tuple[Vector, float]:
    """Direction of the tip and length of the way (m) where no edge will do.

    Args:
        tools: Obstacle tools (n, 11).
        keep: Distances of the axes to keep (n), m.
        q_min: Least insertion, m.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: Where it is to go, m.
    """
    shaft = sub(goal, g)
    u, depth = unit(shaft), norm(shaft)
    low, high = min(q_min, depth), depth
    if not is_free(tools, keep, -1, g, p, along(g, low, u)):
        inside = sub(p, g)
        q = norm(inside)
        back = unit(inside)
        return (-back[0], -back[1], -back[2]), max(0.0, q - low) + depth - low
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if is_free(tools, keep, -1, g, p, along(g, middle, u)):
            low = middle
        else:
            high = middle
    way = sub(along(g, low, u), p)
    return unit(way, u), norm(way) + depth - low


@compiled
def choose_way(
    params: Any,
    workspace: Any,
    view_cone: Numbers,
    g: Vector,
    p: Vector,
    goal: Vector,
    tools: np.ndarray,
    edge: int,
    waits: int,
) -> Choice:
    """The way of R's tip at this instant.

    Args:
        params: A record of `tool_bypass.constants`.
        workspace: A record of `workspace.constants`.
        view_cone: Apex, axis, half angle (7).
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, m.
        tools: Obstacle tools (n, 11), see `shadow_body`.
        edge: The way in use: STRAIGHT, OVER, or an edge's number.
        waits: Number of the pose that R waits in, 0 if it does not wait.

    Returns:
        Unit direction of the tip, length of the way in m, the way's number, that of
        the pose to wait in, and where it goes (the target, or a pose to wait in).
    """
    count = len(tools)
    room = params.freed_room if waits else params.blocked_room
    is_blocked = False
    for i in range(count):
        if pose_distance(tools[i], g, goal) < tools[i, SAFE] + room:
            is_blocked = True
    if is_blocked:
        goal, waits = waiting_pose(
            params, workspace, view_cone, g, p, goal, tools, waits
        )
    else:
        waits = 0
    keep = np.empty(count)
    for i in range(count):
        rho = pose_distance(tools[i], g, goal) - params.goal_slack
        keep[i] = max(tools[i, SAFE] + params.goal_slack, min(tools[i, PLAN], rho))
    way = sub(goal, p)
    if is_free(tools, keep, -1, g, p, goal):
        return unit(way), norm(way), STRAIGHT, waits, goal
    # Where R is nearer already, a leg is held to lead no nearer.
    legs = np.empty(count)
    for i in range(count):
        legs[i] = min(keep[i], pose_distance(tools[i], g, p) - _SLACK)
    best, least, direction = OVER, 1e9, (0.0, 0.0, 0.0)
    kept, kept_direction = 1e9, direction
    for number in range(1, 2 * count + 1):
        i = (number - 1) // 2
        if way_distance(tools[i], g, p, goal) >= keep[i]:
            continue
        a, p_o = xyz(tools[i], FULCRUM), xyz(tools[i], TIP)
        if number % 2 == 1:
            route = top_edge(g, p, goal, a, p_o, keep[i], workspace, view_cone)
        else:
            route = tip_edge(g, p, goal, a, p_o, keep[i], workspace, view_cone)
        is_there, length, toward, middle = route
        if not is_there:
            continue
        if count > 1 and not (
            is_free(tools, legs, i, g, p, middle)
            and is_free(tools, keep, i, g, middle, goal)
        ):
            continue
        if number == edge:
            kept, kept_direction = length, toward
        if length < least:
            best, least, direction = number, length, toward
    if kept < 1e8 and least > params.switch_ratio * kept - params.switch_gain:
        return kept_direction, kept, edge, waits, goal
    if best != OVER and (edge != OVER or count == 1):
        return direction, least, best, waits, goal
    over, length = up_and_over(tools, legs, workspace.min_insertion, g, p, goal)
    if least < params.switch_ratio * length - params.switch_gain:
        return direction, least, best, waits, goal
    return over, length, OVER, waits, goal
