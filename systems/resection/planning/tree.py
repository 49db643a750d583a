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
from systems.common.compiled import compiled
from systems.common.geometry import Vector, dot, norm, sub

DIRECT = 0.030
"""Longest way of the tool, in m, for which the straight line is tried first."""


CELL = 2e-3
"""Edge in m of the cells in which nodes are looked up by their tools."""

CELLS = 1 << 14

NOWHERE = -1
"""No node."""

SHELLS = 6
"""Cells looked through around a point, in each direction, before all nodes are."""


class Tree(NamedTuple):
    """Nodes and route.

    Attributes:
        x: Postures (capacity, 7).
        parent: Node each was driven from, int32 (capacity); -1 for home.
        depth: Edges up to home, int32 (capacity).
        tip: Where the tool is there in m, (capacity, 3).
        route: Nodes in the order of their visits, int32.
        size: Nodes, route entries, and the home of the entry worked through: nodes
            before it are of others, int64 (3).
        last: The latest node of each cell, int32 (CELLS); -1 if it has none.
        earlier: The node of its cell before each one, int32 (capacity).
    """

    x: Any
    parent: Any
    depth: Any
    tip: Any
    route: Any
    size: Any
    last: Any
    earlier: Any


def new_tree(home: Any, tip: Any, nodes: int, visits: int) -> Tree:
    """A tree that holds home alone, where the robot stands."""
    tree = Tree(
        np.zeros((nodes, 7)),
        np.full(nodes, -1, np.int32),
        np.zeros(nodes, np.int32),
        np.zeros((nodes, 3)),
        np.zeros(visits, np.int32),
        np.array([1, 1, 0]),
        np.full(CELLS, -1, np.int32),
        np.full(nodes, -1, np.int32),
    )
    tree.x[0], tree.tip[0] = home, tip
    enlist(tree, 0)
    return tree


def tree_of(
    x: Any,
    parent: Any,
    depth: Any,
    tip: Any,
    route: Any,
    home: int,
    nodes: int,
    visits: int,
) -> Tree:
    """A tree of nodes and a route through its last home, with room for more."""
    tree = grown(new_tree(x[0], tip[0], 1, 1), len(x) + nodes, len(route) + visits)
    for whole, part in ((tree.x, x), (tree.parent, parent), (tree.tip, tip)):
        whole[: len(x)] = part
    tree.depth[: len(x)] = depth
    tree.route[: len(route)] = route
    tree.size[:] = len(x), len(route), home
    enlist_all(tree)
    return tree


def enlist_all(tree: Tree) -> None:
    """Finds anew which nodes of the entry are looked up where."""
    tree.last[:] = -1
    for node in range(tree.size[2], tree.size[0]):
        enlist(tree, node)


def copied(tree: Tree, nodes: int, visits: int) -> Tree:
    """A tree of its own, with room for so many more nodes and visits."""
    n, m, home = map(int, tree.size)
    parts = tree.x[:n], tree.parent[:n], tree.depth[:n], tree.tip[:n]
    return tree_of(*parts, tree.route[:m], home, nodes, visits)


def grown(tree: Tree, nodes: int, visits: int) -> Tree:
    """The tree with room for so many more nodes and visits."""

    def more(a: Any, used: int, extra: int) -> Any:
        if len(a) - used >= extra:
            return a
        wider = np.zeros((max(2 * len(a), used + extra), *a.shape[1:]), a.dtype)
        wider[:used] = a[:used]
        return wider

    n, m, _ = tree.size
    return Tree(
        more(tree.x, n, nodes),
        more(tree.parent, n, nodes),
        more(tree.depth, n, nodes),
        more(tree.tip, n, nodes),
        more(tree.route, m, visits),
        tree.size,
        tree.last,
        more(tree.earlier, n, nodes),
    )


@compiled
def cell_of(i: int, j: int, k: int) -> int:
    """Where a cell is found in `Tree.last`."""
    return (i * 73856093 ^ j * 19349663 ^ k * 83492791) & (CELLS - 1)


@compiled
def enlist(t: Tree, node: int) -> None:
    """Makes a node, the latest, one that is found by its tool."""
    i = math.floor(t.tip[node, 0] / CELL)
    j = math.floor(t.tip[node, 1] / CELL)
    k = math.floor(t.tip[node, 2] / CELL)
    cell = cell_of(i, j, k)
    t.earlier[node], t.last[cell] = t.last[cell], node


@compiled
def cut(t: Tree, nodes: int, visits: int) -> None:
    """Forgets all nodes and visits beyond these many."""
    for node in range(t.size[0] - 1, nodes - 1, -1):
        i = math.floor(t.tip[node, 0] / CELL)
        j = math.floor(t.tip[node, 1] / CELL)
        k = math.floor(t.tip[node, 2] / CELL)
        t.last[cell_of(i, j, k)] = t.earlier[node]
    t.size[0], t.size[1] = nodes, visits


@compiled
def here(t: Tree) -> int:
    """The node at which the robot stands."""
    node: Any = np.int64(t.route[t.size[1] - 1])
    return node


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
    enlist(t, node)
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
    back = np.empty(t.depth[node] + 1, np.int64)
    way = np.empty(t.depth[start] + t.depth[node] + 2, np.int64)
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
def nearest_nodes(t: Tree, p: Vector, found: Any, far: Any) -> None:
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
    a, b, c = math.floor(p[0] / CELL), math.floor(p[1] / CELL), math.floor(p[2] / CELL)
    for shell in range(SHELLS + 1):
        for i in range(a - shell, a + shell + 1):
            for j in range(b - shell, b + shell + 1):
                side = abs(i - a) == shell or abs(j - b) == shell
                for k in range(c - shell, c + shell + 1, 1 if side else 2 * shell):
                    node: Any = np.int64(t.last[cell_of(i, j, k)])
                    while node >= 0:
                        # A node of another cell may be listed with those of this.
                        if (
                            math.floor(t.tip[node, 0] / CELL) == i
                            and math.floor(t.tip[node, 1] / CELL) == j
                            and math.floor(t.tip[node, 2] / CELL) == k
                        ):
                            _rank(t, p, node, found, far)
                        node = np.int64(t.earlier[node])
        if far[count - 1] <= (shell * CELL) ** 2:
            return
    for n in range(count):
        found[n] = -1
        far[n] = math.inf
    for node in range(t.size[2], t.size[0]):
        _rank(t, p, node, found, far)


@compiled
def _rank(t: Tree, p: Vector, node: int, found: Any, far: Any) -> None:
    """Puts a node among the nearest if it is one."""
    d = sub((t.tip[node, 0], t.tip[node, 1], t.tip[node, 2]), p)
    d2 = dot(d, d)
    n = len(found) - 1
    if d2 < far[n]:
        while n > 0 and far[n - 1] > d2:
            far[n], found[n] = far[n - 1], found[n - 1]
            n -= 1
        far[n], found[n] = d2, node
