"""Growing the tree towards tissue that is still there, by random small steps.

A target is a point near a remaining voxel where the tool's ball fits. The step
starts at a node whose tool is near; it keeps the node's two axes but for a random
turn, and the inverse kinematics gives the posture. The straight way there must be
free, or freed by the tool ahead of the body.
"""

import math
from typing import Any

import numpy as np

from plants.snake.inverse_kernels import REACHED, solve_tool
from plants.snake.kinematics import POINTS, link_axis
from plants.snake.snake_body import (
    Body,
    as_far_as_fits,
    axis_from_entry,
    drive_far,
    from_entry,
    place,
)
from plants.tissue.space import (
    FREE,
    NEIGHBOUR,
    SOLID,
    Space,
    centre,
    count_solid,
    first_forbidden,
    roll_back,
    voxel_of,
)
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, dot, sub, unit, xyz
from systems.resection.planning.draws import Draws, below, normal, uniform
from systems.resection.planning.tree import (
    Tree,
    add_node,
    extend,
    here,
    nearest_nodes,
    visit,
)

NEAR = 12
"""Nodes near the target among which a step's start is drawn."""

PLACES = 8
"""Places of the tool looked at for one target."""

NUDGE = 0.2e-3
"""How far from a seat a place is looked for, in m, at most times 2, 4, 6."""

WAYS = 3
"""Ways to a place tried, each from a node near it and with axes of its own."""


@compiled
def tilted(d: Draws, n: Numbers, spread: float) -> Vector:
    """An axis turned at random, by about `spread` rad in either direction."""
    return unit(
        (
            n[0] + spread * normal(d),
            n[1] + spread * normal(d),
            n[2] + spread * normal(d),
        )
    )


@compiled
def distance2(p: Numbers, q: Numbers) -> float:
    """Square of the distance between two points."""
    d = sub(p, q)
    return dot(d, d)


@compiled
def tool_posture(b: Body, p: Numbers, n: Numbers, m: Numbers, x: Any) -> bool:
    """The posture (7,) with the tool at p, its axis n, intermediate axis m."""
    q, u, v = from_entry(b, p), axis_from_entry(b, n), axis_from_entry(b, m)
    return solve_tool(q, u, v, b.h, b.tool, b.bend, (b.low, b.high), x) == REACHED


@compiled
def grow(
    s: Space,
    b: Body,
    t: Tree,
    draws: Draws,
    wanted: Any,
    tries: Any,
    seats: Any,
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
        seats: Of all voxels the nearest at which the tool's ball fits, int32.
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
    c, x = np.empty((POINTS, 3)), np.empty(7)
    tight = b.radius / s.spacing - 2 * NEIGHBOUR
    made = 0
    for _ in range(attempts):
        # Of a few voxels drawn the one asked for least, and in a plan the nearest.
        pick, least_far = -1, math.inf
        at_node = here(t)
        for _ in range(6):
            at = below(draws, len(wanted))
            if s.tau[wanted[at]] != SOLID or tries[at] >= weary:
                continue
            away = 1.0 + tries[at]
            if moving:
                away *= distance2(centre(s, wanted[at]), t.tip[at_node])
            if away < least_far:
                pick, least_far = at, away
        if pick < 0:
            continue
        v = centre(s, wanted[pick])
        # Of some places that hold the voxel the one where most is left.
        most, p = 0, v
        for turn in range(PLACES):
            d = tilted(draws, (0.0, 0.0, 0.0), 1.0)
            if turn % 2:
                q = along(v, b.radius * uniform(draws) ** (1 / 3), d)
            else:
                # At the wall the ball fits in few places: near the seat.
                seat = centre(s, seats[wanted[pick]])
                q = along(seat, turn * NUDGE * uniform(draws), d)
            at = voxel_of(s, q)
            if at < 0 or s.inside[at] < tight or distance2(q, v) > b.frees**2:
                continue
            if first_forbidden(s, q, b.radius) == FREE:
                there = count_solid(s, q, b.frees, s.solid)
                if there > most:
                    most, p = there, q
        tries[pick] += 1
        if most < least:
            continue
        nearest_nodes(t, p, found, far)
        if far[0] > (3 * b.radius) ** 2:
            continue  # not yet: the frontier is far from here
        close = moving and distance2(p, t.tip[at_node]) < (3 * b.radius) ** 2
        for way in range(WAYS):
            node = found[int(NEAR * uniform(draws) ** 2)]
            if node < 0:
                node = found[0]
            if way == 0 and close:
                node = at_node  # from where it stands it need not go anywhere first
            place(b, t.x[node], c)
            spread = 0.5 * uniform(draws) ** 2
            k = tilted(draws, link_axis(c, 5, b.h), spread)
            m = tilted(draws, link_axis(c, 3, b.h), spread)
            if not tool_posture(b, p, k, m, x):
                continue
            if not as_far_as_fits(s, b, t.x[node], x):
                continue
            place(b, x, c)
            if count_solid(s, xyz(c[7], 0), b.frees, s.solid) < least:
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
