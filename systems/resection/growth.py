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
from systems.common.compiled import compiled
from systems.resection.snake_body import corners, drive_far
from systems.resection.space import FREE, SOLID, first_forbidden, roll_back
from systems.resection.tree import add_node, extend, nearest_nodes, visit

NEAR = 12
"""Nodes near the target among which a step's start is drawn."""

TRIES = 250
"""Failed attempts after which a voxel is asked for no more."""


@compiled
def tilted(n: Any, spread: float, out: Any) -> None:
    """An axis turned at random, by about `spread` rad in either direction."""
    for r in range(3):
        out[r] = n[r] + spread * np.random.normal()
    size = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for r in range(3):
        out[r] /= size


@compiled
def seed_random(seed: int) -> None:
    """Seeds the random numbers of compiled functions."""
    np.random.seed(seed)


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
    wanted: Any,
    tries: Any,
    attempts: int,
    least: int,
    moving: bool,
    why: Any,
) -> int:
    """Tries to reach wanted voxels, one random step each.

    Args:
        s: The space.
        b: The body.
        t: The tree.
        wanted: Flat indices of voxels to reach.
        tries: Failed attempts so far, int32, one a wanted voxel.
        attempts: How many to make.
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
    _, ny, nz = s.size
    made = 0
    for _ in range(attempts):
        # Of a few voxels drawn the one asked for least.
        pick = -1
        for _ in range(6):
            at = np.random.randint(len(wanted))
            if s.tau[wanted[at]] != SOLID or tries[at] > TRIES:
                continue
            if pick < 0 or tries[at] < tries[pick]:
                pick = at
        if pick < 0:
            continue
        voxel = wanted[pick]
        i, j, k = voxel // (ny * nz), voxel // nz % ny, voxel % nz
        v0 = s.origin[0] + s.spacing * i
        v1 = s.origin[1] + s.spacing * j
        v2 = s.origin[2] + s.spacing * k
        fits = False
        for _ in range(12):
            tilted(np.zeros(3), 1.0, p[0])
            r = b.radius * np.random.random() ** (1 / 3)
            p[0, 0] = v0 + r * p[0, 0]
            p[0, 1] = v1 + r * p[0, 1]
            p[0, 2] = v2 + r * p[0, 2]
            if first_forbidden(s, p[0, 0], p[0, 1], p[0, 2], b.radius) == FREE:
                fits = True
                break
        if not fits:
            tries[pick] += 3
            continue
        nearest_nodes(t, p[0, 0], p[0, 1], p[0, 2], found, far)
        if far[0] > (3 * b.radius) ** 2:
            continue  # not yet: the frontier is far from here
        draw = int(NEAR * np.random.random() ** 2)
        node = found[draw]
        if node < 0:
            node = found[0]
        corners(t.x[node], b.h, b.tool, c)
        link = 2 * b.h
        for r in range(3):
            n[0, r] = (c[6, r] - c[5, r]) / link
            m[0, r] = (c[4, r] - c[3, r]) / link
        tries[pick] += 1
        spread = 0.5 * np.random.random() ** 2
        tilted(n[0].copy(), spread, n[0])
        tilted(m[0].copy(), spread, m[0])
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
    return made
