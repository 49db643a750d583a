"""The way of R's tip among organs and tools: a taut string over a terrain.

A straight tool through its fulcrum G is free if and only if its tip is no deeper along
its direction than R, the first depth at which the ray from G comes too near to
anything: organs of any shape, and tools with their shadows, are one terrain of depths.

Over the great circle from the tip's direction to the goal's, unrolled into the plane,
the shortest way under the gates r <= R_i is a taut string. In the coordinates

    x = tan(theta),    y = 1 / (r cos(theta))

lines are lines, so that it is the upper hull of start, gates and goal: straight, or
withdraw, swing and insert with its corners cut. If the straight way is not free the
great circles over a point beside it are tried too, and the shortest is taken.
"""

from math import cos, pi, sin, tan
from typing import Any, NamedTuple

import numpy as np

from plants.organs.distance import PLAN, SAFE, Organs, clear_depth, shaft_distance
from systems.bypass.bypass_route import STRAIGHT, Choice, is_free
from systems.bypass.shadow_body import free_depth, pose_distance, read_tool
from systems.bypass.tip_edge import arccos, fan
from systems.bypass.waiting_pose import turned, waiting_pose
from systems.bypass.workspace import is_inside
from systems.common.compiled import compiled
from systems.common.geometry import (
    across,
    along,
    any_perpendicular,
    cross,
    dot,
    norm,
    over,
    sub,
    unit,
)
from systems.common.signal import Vector
from systems.common.signals import ViewCone

ORGAN = 90
"""`Way.waiting` where no straight tool reaches the target: an organ is before it."""
RETRACT = -2
"""`Way.way` where R only draws back; below it the great circles, the direct one -3."""

_RAYS = 24
_BESIDE = (0.06, 0.12, 0.2, 0.3, 0.42)
"""How far beside the straight great circle others lead, rad."""
_BETTER, _GAIN = 0.93, 0.002
"""Another great circle is taken if its way is shorter by this share, and by this, m."""
_PASSED = 0.05
"""A point beside is behind within this angle, rad."""
_LITTLE = 1e-5


class Found(NamedTuple):
    """A way: its first corner, how long it is from there in m, and as `Choice`."""

    corner: Vector
    rest: float
    edge: int
    waits: int
    aim: Vector


@compiled
def terrain(
    organs: Organs,
    keep_organs: np.ndarray,
    tools: np.ndarray,
    keep_tools: np.ndarray,
    g: Vector,
    u: Vector,
    most: float,
) -> float:
    """R: how deep a straight tool may reach along u, m; no more than `most`."""
    for i in range(len(tools)):
        most = min(most, free_depth(g, u, read_tool(tools[i]), keep_tools[i]))
    return clear_depth(organs, keep_organs, g, u, most)


@compiled
def taut(
    theta: np.ndarray, depth: np.ndarray, q: float, q_goal: float
) -> tuple[float, float, float]:
    """The taut string over gates.

    Args:
        theta: Angles from the start, rising, the last one the goal's (n), rad.
        depth: Greatest depth at each but the goal (n), m.
        q: Depth of the start, m.
        q_goal: That of the goal, m.

    Returns:
        Its length in m, and angle and depth of its first corner, or of the goal.
    """
    n = len(theta)
    middle = 0.5 * theta[n - 1]
    x, y, r = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    x[0], r[0] = tan(-middle), q
    y[0] = 1.0 / (q * cos(middle))
    for i in range(n):
        r[i + 1] = q_goal if i == n - 1 else depth[i]
        x[i + 1] = tan(theta[i] - middle)
        y[i + 1] = 1.0 / (r[i + 1] * cos(theta[i] - middle))
    hull = np.zeros(n + 1, np.int64)
    size = 1
    for i in range(1, n + 1):
        while size > 1:
            a, b = hull[size - 2], hull[size - 1]
            turn = (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a])
            if turn < 0.0:
                break
            size -= 1
        hull[size] = i
        size += 1
    length, last, at = 0.0, 0.0, q
    for k in range(1, size):
        i = hull[k]
        length += fan(at, r[i], theta[i - 1] - last)
        last, at = theta[i - 1], r[i]
    first = hull[1]
    return length, theta[first - 1], r[first]


@compiled
def bend(u: Vector, w: Vector) -> tuple[float, Vector]:
    """Angle from the unit vector u to w, and the unit vector across u towards w."""
    return arccos(dot(u, w)), unit(across(w, u), any_perpendicular(u))


@compiled
def way_over(
    organs: Organs,
    keep_organs: np.ndarray,
    tools: np.ndarray,
    keep_tools: np.ndarray,
    workspace: Any,
    view_cone: ViewCone,
    g: Vector,
    p: Vector,
    goal: Vector,
    beside: float,
) -> tuple[Vector, float, bool]:
    """The taut way over the great circle, or over two by a point beside it.

    Args:
        organs: The organs.
        keep_organs: Distances of R's axis to keep from them (n), m.
        tools: Rows of `ObstacleTool`.
        keep_tools: Distances of the axes to keep (m), m.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: Where it is to go, m.
        beside: Angle of the point from the middle of the great circle, to its left if
            positive, rad; 0 for none.

    Returns:
        Its first corner, or its end, its length in m (1e9 if there is none), and
        whether it is straight.
    """
    shaft, other = sub(p, g), sub(goal, g)
    q, q_goal = norm(shaft), norm(other)
    u, w = over(shaft, q), over(other, q_goal)
    angle, toward = bend(u, w)
    second, onwards, via = 0.0, toward, w
    if beside != 0.0:
        middle = turned(u, toward, 0.5 * angle)
        via = turned(middle, cross(middle, turned(toward, u, -0.5 * angle)), beside)
        angle, toward = bend(u, via)
        second, onwards = bend(via, w)
    total = angle + second
    if (beside != 0.0 and angle < _PASSED) or total > 0.9 * pi:
        return goal, 1e9, False
    if total < 1e-4:  # the goal is straight above or below
        deep = terrain(organs, keep_organs, tools, keep_tools, g, w, q_goal)
        if q_goal > deep + _LITTLE:
            return goal, 1e9, False
        return goal, norm(sub(goal, p)), True
    theta, depth = np.empty(_RAYS), np.empty(_RAYS)
    is_open, from_inside = True, is_inside(workspace, view_cone, g, p)
    for i in range(_RAYS):
        t = total * (i + 1.0) / _RAYS
        theta[i] = t
        if i == _RAYS - 1:
            break
        # Nothing is deeper than the straight line of the unrolled plane.
        line = q * q_goal * sin(total) / (q * sin(t) + q_goal * sin(total - t))
        ray = turned(u, toward, t) if t <= angle else turned(via, onwards, t - angle)
        deep = terrain(organs, keep_organs, tools, keep_tools, g, ray, line)
        depth[i] = deep
        if deep < line:
            is_open = False
            if deep < workspace.min_insertion:
                return goal, 1e9, False
        is_corner = from_inside and (deep < line or beside != 0.0)
        if is_corner and not is_inside(workspace, view_cone, g, along(g, deep, ray)):
            return goal, 1e9, False
    length, t, r = taut(theta, depth, q, q_goal)
    if t > angle:  # straight past the point beside: it is where the string crosses it
        r = q * r * sin(t) / (q * sin(angle) + r * sin(t - angle))
        t = angle
    corner = along(g, r, turned(u, toward, t))
    return corner, length, is_open and beside == 0.0


@compiled
def organ_room(
    organs: Organs, slack: float, g: Vector, goal: Vector
) -> tuple[float, np.ndarray]:
    """How much farther than must be a tool from g to a goal is from the organs, m.

    And what ways there keep from each of them (n), m: no more than it does itself.
    """
    room, keep = 1e9, np.empty(len(organs.table))
    for k in range(len(keep)):
        safe, plan = organs.table[k, SAFE], organs.table[k, PLAN]
        own, _ = shaft_distance(organs, k, g, goal, plan)
        room = min(room, own - safe)
        keep[k] = max(safe + slack, min(plan, own - slack))
    return room, keep


@compiled
def before_all(
    organs: Organs, tools: np.ndarray, room: float, g: Vector, goal: Vector
) -> Vector:
    """The deepest free place on the goal's own line, m, `room` before what is there."""
    keep, keep_tools = organs.table[:, SAFE] + room, np.empty(len(tools))
    for i in range(len(tools)):
        keep_tools[i] = read_tool(tools[i]).safe + room
    shaft = sub(goal, g)
    u = unit(shaft)
    deep = terrain(organs, keep, tools, keep_tools, g, u, norm(shaft))
    return along(g, max(1e-3, deep - 1e-4), u)


@compiled
def choose_way_over(
    params: Any,
    workspace: Any,
    view_cone: ViewCone,
    organs: Organs,
    g: Vector,
    p: Vector,
    goal: Vector,
    tools: np.ndarray,
    edge: int,
    waits: int,
) -> Found:
    """The way of R's tip, as `bypass_route.choose_way`.

    Args:
        params: A record of `tool_bypass.constants`.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        organs: The organs.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, m.
        tools: Rows of `ObstacleTool`.
        edge: The way in use.
        waits: Number of the pose that R waits in, 0 if it does not wait.
    """
    count, is_blocked = len(tools), False
    room = params.freed_room if waits else params.blocked_room
    for i in range(count):
        tool = read_tool(tools[i])
        if pose_distance(tool, g, goal) < tool.safe + room:
            is_blocked = True
    slack = params.goal_slack
    free, keep_organs = organ_room(organs, slack, g, goal)
    if free < room:
        goal, waits = before_all(organs, tools, params.waiting_room, g, goal), ORGAN
        free, keep_organs = organ_room(organs, slack, g, goal)
    elif is_blocked:
        goal, waits = waiting_pose(
            params, workspace, view_cone, g, p, goal, tools, waits
        )
        free, keep_organs = organ_room(organs, slack, g, goal)
        if free < params.blocked_room:
            goal = before_all(organs, tools, params.waiting_room, g, goal)
            free, keep_organs = organ_room(organs, slack, g, goal)
    else:
        waits = 0
    keep = np.empty(count)
    for i in range(count):
        tool = read_tool(tools[i])
        rho = pose_distance(tool, g, goal) - slack
        keep[i] = max(tool.safe + slack, min(tool.plan, rho))
    around = (organs, keep_organs, tools, keep, workspace, view_cone)
    corner, least, is_open = way_over(*around, g, p, goal, 0.0)
    if is_open and is_free(tools, keep, -1, g, p, goal):
        return Found(goal, 0.0, STRAIGHT, waits, goal)
    best = RETRACT - 1
    kept, kept_corner = least if edge == best else 1e9, corner
    for j in range(2 * len(_BESIDE)):
        number = RETRACT - 2 - j
        beside = _BESIDE[j // 2] * (1.0 - 2.0 * (j % 2))
        other, length, _ = way_over(*around, g, p, goal, beside)
        if number == edge:
            kept, kept_corner = length, other
        if length < least:
            best, least, corner = number, length, other
    if kept < 1e8 and least > _BETTER * kept - _GAIN:
        best, least, corner = edge, kept, kept_corner
    if least < 1e8:
        return Found(corner, least - norm(sub(corner, p)), best, waits, goal)
    u = unit(sub(p, g))
    return Found(along(g, workspace.min_insertion, u), 0.0, RETRACT, waits, goal)


@compiled
def on_the_way(found: Found, p: Vector, goal: Vector) -> Choice:
    """The way of the tip p once it is found; straight ones lead to the goal itself."""
    corner, aim = found.corner, found.aim
    if found.edge == STRAIGHT and found.waits == 0:
        corner, aim = goal, goal
    way = sub(corner, p)
    length = norm(way) + found.rest
    return Choice(unit(way), length, found.edge, found.waits, aim)
