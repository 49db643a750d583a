"""The tree of all postures reached so far, and the route that visits them.

Every posture but home hangs by an edge that was driven, so any two are joined by
a path that is free: a path once driven stays free. The route is the plan itself,
the order in which the tree's nodes are visited; a voxel's arrival time counts its
entries.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from plants.snake.kinematics import POINTS
from plants.snake.snake_body import OK, Body, drive, place
from plants.tissue.space import Space, roll_back
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import dot, norm, sub

DIRECT = 0.030
"""Longest way of the tool, in m, for which the straight line is tried first."""


class Tree(NamedTuple):
    """Nodes and route.

    Attributes:
        x: Postures (capacity, 7).
        parent: Node each was driven from, int32 (capacity); -1 for home.
        depth: Edges up to home, int32 (capacity).
        tip: Where the tool is there in m, (capacity, 3).
        route: Nodes in the order of their visits, int32.
        size: Nodes and route entries, int64 (2).
    """

    x: Any
    parent: Any
    depth: Any
    tip: Any
    route: Any
    size: Any


def new_tree(home: Any, tip: Any, nodes: int, visits: int) -> Tree:
    """A tree that holds home alone, where the robot stands."""
    tree = Tree(
        np.zeros((nodes, 7)),
        np.full(nodes, -1, np.int32),
        np.zeros(nodes, np.int32),
        np.zeros((nodes, 3)),
        np.zeros(visits, np.int32),
        np.array([1, 1]),
    )
    tree.x[0], tree.tip[0] = home, tip
    return tree


def grown(tree: Tree, nodes: int, visits: int) -> Tree:
    """The tree with room for so many more nodes and visits."""

    def more(a: Any, used: int, extra: int) -> Any:
        if len(a) - used >= extra:
            return a
        wider = np.zeros((max(2 * len(a), used + extra), *a.shape[1:]), a.dtype)
        wider[:used] = a[:used]
        return wider

    n, m = tree.size
    return Tree(
        more(tree.x, n, nodes),
        more(tree.parent, n, nodes),
        more(tree.depth, n, nodes),
        more(tree.tip, n, nodes),
        more(tree.route, m, visits),
        tree.size,
    )


@compiled
def here(t: Tree) -> int:
    """The node at which the robot stands."""
    return t.route[t.size[1] - 1]


@compiled
def visit(t: Tree, node: int) -> None:
    """Appends a node to the route."""
    if t.size[1] >= len(t.route):
        raise IndexError("the tree's route is full")
    t.route[t.size[1]] = node
    t.size[1] += 1


@compiled
def add_node(t: Tree, b: Body, parent: int, x: Any) -> int:
    """Hangs a posture to a node; returns the new node."""
    node = t.size[0]
    if node >= len(t.x):
        raise IndexError("the tree is full")
    c = np.empty((POINTS, 3))
    place(b, x, c)
    t.x[node], t.tip[node] = x, c[7]
    t.parent[node] = parent
    t.depth[node] = t.depth[parent] + 1
    t.size[0] += 1
    return node


@compiled
def go_to(s: Space, b: Body, t: Tree, node: int, why: Any) -> None:
    """Drives to a node of the tree, straight if it can be, else along the tree."""
    start = here(t)
    if node == start:
        return
    near = norm(sub(t.tip[node], t.tip[start])) < DIRECT
    if near and drive(s, b, t.x[start], t.x[node], t.size[1], why) == OK:
        visit(t, node)
        return
    # Up to where both branches meet, then down.
    up, down = start, node
    back = np.empty(t.depth[node] + 1, np.int32)
    way = np.empty(t.depth[start] + t.depth[node] + 2, np.int32)
    ups, downs = 0, 0
    way[0] = start
    while up != down:
        if t.depth[up] >= t.depth[down]:
            up = t.parent[up]
            ups += 1
            way[ups] = up
        else:
            back[downs] = down
            downs += 1
            down = t.parent[down]
    count = ups
    for n in range(downs - 1, -1, -1):
        count += 1
        way[count] = back[n]
    # Shorten: from each node straight to one farther on where that is free.
    at = 0
    while at < count:
        jump = count - at
        while jump > 1:
            if drive(s, b, t.x[way[at]], t.x[way[at + jump]], t.size[1], why) == OK:
                break
            jump //= 2
        at += max(jump, 1)
        visit(t, way[at])


@compiled
def extend(s: Space, b: Body, t: Tree, node: int, x: Any, why: Any) -> int:
    """Goes to a node and from there to a new posture.

    Returns:
        The new node, or minus the status if the way from node to posture is not
        free: then nothing has happened.
    """
    if node != here(t):
        freed, roomed = s.used[0], s.used[1]
        status = drive(s, b, t.x[node], x, t.size[1], why)
        if status != OK:
            return -status
        # It can be done: undo it, since on the way there it has not been yet.
        roll_back(s, freed, roomed)
        go_to(s, b, t, node, why)
    status = drive(s, b, t.x[node], x, t.size[1], why)
    if status != OK:
        return -status
    new = add_node(t, b, node, x)
    visit(t, new)
    return new


@compiled
def nearest_nodes(t: Tree, p: Numbers, found: Any, far: Any) -> None:
    """The len(found) nodes whose tools are nearest to a point, nearest first.

    Args:
        t: The tree.
        p: The point.
        found: Takes the nodes, (n,); -1 where there are no more.
        far: Takes the squares of their distances.
    """
    count = len(found)
    for n in range(count):
        found[n] = -1
        far[n] = math.inf
    for node in range(t.size[0]):
        d = sub((t.tip[node, 0], t.tip[node, 1], t.tip[node, 2]), p)
        d2 = dot(d, d)
        if d2 < far[count - 1]:
            n = count - 1
            while n > 0 and far[n - 1] > d2:
                far[n], found[n] = far[n - 1], found[n - 1]
                n -= 1
            far[n], found[n] = d2, node
