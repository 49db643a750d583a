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

from typing import Any, NamedTuple

import numpy as np

from systems.bypass.shadow_body import pose_distance, read_tool, way_distance
from systems.bypass.tip_edge import tip_edge
from systems.bypass.top_edge import top_edge
from systems.bypass.waiting_pose import waiting_pose
from systems.common.compiled import compiled
from systems.common.geometry import along, norm, scaled, sub, unit
from systems.common.signal import Vector
from systems.common.signals import ViewCone

STRAIGHT = 0
OVER = -1
"""Up and over everything; edges: 1 and 2 (top and tip) of tool 0, 3 and 4 of 1 ..."""

_SLACK = 1e-4
"""How much nearer to a tool than now a leg may lead where R is near already, m."""
_HALVINGS = 12


class Choice(NamedTuple):
    """The way of R's tip: its direction, length in m and number; where it goes to.

    That is the target, or a pose to wait in: number `waits`, 0 if R does not wait.
    """

    direction: Vector
    length: float
    edge: int
    waits: int
    aim: Vector


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
        if i != but and way_distance(read_tool(tools[i]), g, p, goal) < keep[i]:
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
        tools: Rows of `ObstacleTool`.
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
        back = scaled(-1.0, unit(inside))
        return back, max(0.0, norm(inside) - low) + depth - low
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
    view_cone: ViewCone,
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
        view_cone: What the endoscope sees.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, m.
        tools: Rows of `ObstacleTool`.
        edge: The way in use: STRAIGHT, OVER, or an edge's number.
        waits: Number of the pose that R waits in, 0 if it does not wait.
    """
    count = len(tools)
    room = params.freed_room if waits else params.blocked_room
    is_blocked = False
    for i in range(count):
        tool = read_tool(tools[i])
        if pose_distance(tool, g, goal) < tool.safe + room:
            is_blocked = True
    if is_blocked:
        goal, waits = waiting_pose(
            params, workspace, view_cone, g, p, goal, tools, waits
        )
    else:
        waits = 0
    keep = np.empty(count)
    for i in range(count):
        tool = read_tool(tools[i])
        rho = pose_distance(tool, g, goal) - params.goal_slack
        keep[i] = max(tool.safe + params.goal_slack, min(tool.plan, rho))
    way = sub(goal, p)
    if is_free(tools, keep, -1, g, p, goal):
        return Choice(unit(way), norm(way), STRAIGHT, waits, goal)
    # Where R is nearer already, a leg is held to lead no nearer.
    legs = np.empty(count)
    for i in range(count):
        legs[i] = min(keep[i], pose_distance(read_tool(tools[i]), g, p) - _SLACK)
    best, least, direction = OVER, 1e9, (0.0, 0.0, 0.0)
    kept, kept_direction = 1e9, direction
    for number in range(1, 2 * count + 1):
        i = (number - 1) // 2
        tool = read_tool(tools[i])
        if way_distance(tool, g, p, goal) >= keep[i]:
            continue
        a, p_o = tool.fulcrum, tool.tip
        if number % 2 == 1:
            route = top_edge(g, p, goal, a, p_o, keep[i], workspace, view_cone)
        else:
            route = tip_edge(g, p, goal, a, p_o, keep[i], workspace, view_cone)
        if not route.is_there:
            continue
        if count > 1 and not (
            is_free(tools, legs, i, g, p, route.edge)
            and is_free(tools, keep, i, g, route.edge, goal)
        ):
            continue
        if number == edge:
            kept, kept_direction = route.length, route.direction
        if route.length < least:
            best, least, direction = number, route.length, route.direction
    if kept < 1e8 and least > params.switch_ratio * kept - params.switch_gain:
        return Choice(kept_direction, kept, edge, waits, goal)
    if best != OVER and (edge != OVER or count == 1):
        return Choice(direction, least, best, waits, goal)
    over, length = up_and_over(tools, legs, workspace.min_insertion, g, p, goal)
    if least < params.switch_ratio * length - params.switch_gain:
        return Choice(direction, least, best, waits, goal)
    return Choice(over, length, OVER, waits, goal)
