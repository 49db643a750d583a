"""Growing the tree towards tissue that is still there, by random small steps.

A target is a point near a remaining voxel where the tool's ball fits. The step
starts at a node whose tool is near; it keeps the node's two axes but for a random
turn, and the inverse kinematics gives the posture. The straight way there must be
free, or freed by the tool ahead of the body.
"""

import math
from typing import Any

import numpy as np

from plants.snake.inverse_kernels import solve_tools
from plants.snake.snake_body import corners, drive_far
from plants.tissue.space import FREE, SOLID, count_solid, first_forbidden, roll_back
from systems.common.compiled import compiled
from systems.resection.planning.draws import Draws, below, normal, uniform
from systems.resection.planning.tree import add_node, extend, nearest_nodes, visit

NEAR = 12
"""Nodes near the target among which a step's start is drawn."""

PLACES = 8
"""Places of the tool looked at for one target."""

WAYS = 3
"""Ways to a place tried, each from a node near it and with axes of its own."""


@compiled
def tilted(d: Draws, n: Any, spread: float, out: Any) -> None:
    """An axis turned at random, by about `spread` rad in either direction."""
    for r in range(3):
        out[r] = n[r] + spread * normal(d)
    size = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for r in range(3):
        out[r] /= size


@compiled
def centre(s: Any, voxel: int, out: Any) -> None:
    """Where a voxel's centre lies in W, by its flat index, into out (3,)."""
    _, ny, nz = s.size
    out[0] = s.origin[0] + s.spacing * (voxel // (ny * nz))
    out[1] = s.origin[1] + s.spacing * (voxel // nz % ny)
    out[2] = s.origin[2] + s.spacing * (voxel % nz)


@compiled
def distance2(p: Any, q: Any) -> float:
    """Square of the distance between two points."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@compiled
def tool_posture(b: Any, p: Any, n: Any, m: Any, x: Any) -> bool:
    """The posture with the tool at p, its axis n, intermediate axis m (1, 3 each)."""
    q, status = np.empty((1, 7)), np.empty(1, np.int64)
    solve_tools(p, n, m, b.h, b.tool, b.bend, np.array([b.low, b.high]), q, status)
    if status[0] != 0:
        return False
    x[0] = q[0, 0]
    for k in range(3):
        alpha, beta = q[0, 1 + 2 * k], q[0, 2 + 2 * k]
        sb = math.sin(beta)
        x[1 + 2 * k] = math.atan2(-sb * math.sin(alpha), math.cos(beta))
        x[2 + 2 * k] = math.asin(sb * math.cos(alpha))
    return True


@compiled
def grow(
    s: Any,
    b: Any,
    t: Any,
    draws: Draws,
    wanted: Any,
    tries: Any,
    attempts: int,
    weary: int,
    least: int,
    moving: bool,
    why: Any,
) -> int:
    """Tries to reach wanted voxels, one random step each.

    Args:
        s: The space.
        b: The body.
        t: The tree.
        draws: Where random numbers come from.
        wanted: Flat indices of voxels to reach.
        tries: Failed attempts so far, int32, one a wanted voxel.
        attempts: How many to make.
        weary: Failed attempts after which a voxel is asked for no more.
        least: Voxels that a step must free to be made.
        moving: Whether the robot goes from node to node (a plan), or the tree alone
            counts (what could be reached).
        why: Takes culprits.

    Returns:
        Steps made.
    """
    found, far = np.empty(NEAR, np.int64), np.empty(NEAR)
    p, n, m = np.empty((1, 3)), np.empty((1, 3)), np.empty((1, 3))
    c, x = np.empty((8, 3)), np.empty(7)
    v, d, zero = np.empty(3), np.empty(3), np.zeros(3)
    made = 0
    for _ in range(attempts):
        # Of a few voxels drawn the one asked for least, and in a plan the nearest.
        pick, least_far = -1, math.inf
        here = t.route[t.size[1] - 1]
        for _ in range(6):
            at = below(draws, len(wanted))
            if s.tau[wanted[at]] != SOLID or tries[at] >= weary:
                continue
            away = 1.0 + tries[at]
            if moving:
                centre(s, wanted[at], v)
                away *= distance2(v, t.tip[here])
            if away < least_far:
                pick, least_far = at, away
        if pick < 0:
            continue
        voxel = wanted[pick]
        centre(s, voxel, v)
        # Of some places that hold the voxel the one where most is left.
        most = 0
        for _ in range(PLACES):
            tilted(draws, zero, 1.0, d)
            r = b.radius * uniform(draws) ** (1 / 3)
            q0, q1, q2 = v[0] + r * d[0], v[1] + r * d[1], v[2] + r * d[2]
            if first_forbidden(s, q0, q1, q2, b.radius) == FREE:
                there = count_solid(s, q0, q1, q2, b.frees)
                if there > most:
                    most = there
                    p[0, 0], p[0, 1], p[0, 2] = q0, q1, q2
        tries[pick] += 1
        if most < least:
            continue
        nearest_nodes(t, p[0, 0], p[0, 1], p[0, 2], found, far)
        if far[0] > (3 * b.radius) ** 2:
            continue  # not yet: the frontier is far from here
        close = moving and distance2(p[0], t.tip[here]) < (3 * b.radius) ** 2
        for way in range(WAYS):
            node = found[int(NEAR * uniform(draws) ** 2)]
            if node < 0:
                node = found[0]
            if way == 0 and close:
                node = here  # from where it stands it need not go anywhere first
            corners(t.x[node], b.h, b.tool, c)
            for r in range(3):
                n[0, r] = (c[6, r] - c[5, r]) / (2 * b.h)
                m[0, r] = (c[4, r] - c[3, r]) / (2 * b.h)
            spread = 0.5 * uniform(draws) ** 2
            tilted(draws, n[0].copy(), spread, n[0])
            tilted(draws, m[0].copy(), spread, m[0])
            if not tool_posture(b, p, n, m, x):
                continue
            freed, roomed = s.used[0], s.used[1]
            _, share = drive_far(s, b, t.x[node], x, t.size[1], why)
            gained = s.used[0] - freed
            if gained < least:
                roll_back(s, freed, roomed)
                continue
            for r in range(7):
                x[r] = t.x[node, r] + share * (x[r] - t.x[node, r])
            if moving:
                roll_back(s, freed, roomed)
                if extend(s, b, t, node, x, why) < 0:
                    continue
            else:
                visit(t, add_node(t, b, node, x))
            made += 1
            tries[pick] = 0
            break
    return made
