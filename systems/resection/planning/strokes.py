"""Strokes: continuous moves of the tool that free much for the time they take.

The robot goes on from where it stands while it finds moves, straight in the modules'
angles, that free enough a second: those that carry on count as quicker than those that
turn. If there is none it goes where the next stroke begins: to an edge of a *library*,
moves that a search in thought (`growth.grow`) found, whose gain for the time of going
there and moving is largest. Gains only shrink as space grows, so a gain once measured
bounds the next one, and few are measured twice (lazy greedy).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.snake_body import OK, Body, between, drive, drive_far, place
from plants.tissue.space import (
    FREE,
    Space,
    bit_of,
    count_solid,
    first_forbidden,
    roll_back,
)
from systems.common.compiled import compiled
from systems.common.geometry import norm, sub, xyz
from systems.resection.planning.draws import Draws, normal, uniform
from systems.resection.planning.tree import (
    DIRECT,
    NOWHERE,
    Tree,
    add_node,
    extend,
    go_to,
    here,
    visit,
)

MOVES = 48
"""Moves thought of for one that is made."""

ONWARDS = 4
"""Of them such as carry on."""

DRIVEN = 8
"""Of them driven in thought, those that promise most."""

SHORTEST, LONGEST = 0.04, 0.2
"""Time of a move in s."""

WAIT = 40
"""Visits after which an edge that failed is tried again, before all others are."""

WALL_WEIGHT = 2
"""What a voxel at the wall counts beyond one inside: it is harder to come by."""


class Pace(NamedTuple):
    """How fast the robot moves; SI units, radians.

    Attributes:
        travel: Largest speed of the translation.
        bend: Largest rate of a bend.
        turn: Time in which either is reached from rest.
    """

    travel: float
    bend: float
    turn: float


class Goal(NamedTuple):
    """What is to be freed, as bits laid out as `Space.solid`.

    Attributes:
        whole: All of it.
        wall: What of it lies near where the tool may not be.
    """

    whole: NDArray[np.int64]
    wall: NDArray[np.int64]


class Library(NamedTuple):
    """Edges found in thought.

    Attributes:
        x: Postures where they end, (n, 7).
        parent: Where they begin: a node of the tree, or, from `nodes` on, an edge.
        node: The node of the tree that has the posture, int32 (n); -1 while none has.
        gain: Bound of what they free, (n,).
        known: Visits made when it was measured, int64 (n).
        retry: Visits made when it failed last, int64 (n); -1 if it did not.
        nodes: Nodes of the tree when they were found, int64 (1).
    """

    x: NDArray[np.float64]
    parent: NDArray[np.int32]
    node: NDArray[np.int32]
    gain: NDArray[np.float64]
    known: NDArray[np.int64]
    retry: NDArray[np.int64]
    nodes: NDArray[np.int64]


def new_library(x: NDArray, parent: NDArray, nodes: int) -> Library:
    """Edges from a node, or one of them, to each posture.

    Args:
        x: Postures, (n, 7).
        parent: Nodes below `nodes`, or `nodes` and an edge's number more, (n,).
        nodes: Nodes that the tree has of its own.
    """
    count = len(x)
    return Library(
        np.ascontiguousarray(x),
        parent.astype(np.int32),
        np.full(count, -1, np.int32),
        np.full(count, np.inf),
        np.full(count, -1, np.int64),
        np.full(count, -1, np.int64),
        np.array([nodes]),
    )


def fresh(library: Library) -> Library:
    """The same edges, none of them made."""
    return new_library(library.x, library.parent, int(library.nodes[0]))


@compiled
def time_of(k: Pace, x0: Any, x1: Any) -> float:
    """Time of the straight way between two postures at full speed, in s."""
    most = abs(x1[0] - x0[0]) / k.travel
    for r in range(1, 7):
        most = max(most, abs(x1[r] - x0[r]) / k.bend)
    return most


@compiled
def direction(k: Pace, x0: Any, x1: Any, out: Any) -> None:
    """The straight way's rates (7,) as shares of the largest; zero if there is none."""
    time = max(time_of(k, x0, x1), 1e-9)
    for r in range(7):
        out[r] = (x1[r] - x0[r]) / (time * (k.travel if r == 0 else k.bend))


@compiled
def turning(k: Pace, u: Any, v: Any) -> float:
    """Time that going over from one direction to another takes, in s."""
    most = 0.0
    for r in range(7):
        most = max(most, abs(u[r] - v[r]))
    return k.turn * most


@compiled
def weighed(s: Space, g: Goal, since: int) -> float:
    """What was freed since the journal had so many entries, in weighted voxels."""
    gain = 0
    for n in range(since, s.used[0]):
        word, bit = bit_of(s, s.freed[n])
        gain += (g.whole[word] & bit) != 0
        gain += WALL_WEIGHT * ((g.wall[word] & bit) != 0)
    return float(gain)


@compiled
def _within_limits(b: Body, x: Any) -> None:
    """Brings a posture back into bends and travel, nearly along its own bends."""
    x[0] = min(max(x[0], b.low), b.high)
    for r in (1, 3, 5):
        for _ in range(3):
            beta = math.acos(min(math.cos(x[r]) * math.cos(x[r + 1]), 1.0))
            if beta <= b.bend:
                break
            x[r] *= b.bend / beta
            x[r + 1] *= b.bend / beta


@compiled
def _think(
    s: Space, b: Body, d: Draws, k: Pace, x: Any, v: Any, onwards: bool, out: Any
) -> float:
    """A random move from posture x; as far as the tool may go; share that it may."""
    u = np.zeros(7)
    kind = uniform(d)
    for r in range(7):
        if onwards:
            u[r] = v[r] + 0.15 * normal(d)
        elif r >= 5 or kind > 0.6 or (r == 0 and kind > 0.4):
            u[r] = 2.0 * uniform(d) - 1.0
    most = 1e-9
    for r in range(7):
        most = max(most, abs(u[r]))
    time = SHORTEST + (LONGEST - SHORTEST) * uniform(d)
    for r in range(7):
        out[r] = x[r] + u[r] / most * time * (k.travel if r == 0 else k.bend)
    _within_limits(b, out)
    c, y = np.empty((POINTS, 3)), np.empty(7)
    place(b, out, c)
    if first_forbidden(s, xyz(c[7], 0), b.radius) == FREE:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(5):
        share = (low + high) / 2
        between(x, out, share, y)
        place(b, y, c)
        if first_forbidden(s, xyz(c[7], 0), b.radius) == FREE:
            low = share
        else:
            high = share
    between(x, out, low, y)
    out[:] = y
    return low


@compiled
def stroke_on(
    s: Space,
    b: Body,
    t: Tree,
    d: Draws,
    k: Pace,
    g: Goal,
    least: float,
    v: Any,
    why: Any,
) -> bool:
    """Makes a move from where the robot stands; False if none frees enough.

    Args:
        s: The space.
        b: The body.
        t: The tree.
        d: Where random numbers come from.
        k: The robot's pace.
        g: What is to be freed.
        least: Weighted voxels that it must free a second.
        v: Direction (7,) of the last move; takes that of this one.
        why: Takes culprits.
    """
    node = here(t)
    x = t.x[node].copy()
    c, u, y = np.empty((POINTS, 3)), np.empty(7), np.empty(7)
    moves, promise, costs = np.empty((MOVES, 7)), np.zeros(MOVES), np.empty(MOVES)
    going = time_of(k, np.zeros(7), v) > 0.0
    for n in range(MOVES):
        onwards = going and n < ONWARDS
        if _think(s, b, d, k, x, v, onwards, moves[n]) < 0.1:
            continue
        direction(k, x, moves[n], u)
        costs[n] = turning(k, v, u)
        place(b, moves[n], c)
        p = xyz(c[7], 0)
        gain = count_solid(s, p, b.frees, g.whole)
        gain += WALL_WEIGHT * count_solid(s, p, b.frees, g.wall)
        promise[n] = gain / (time_of(k, x, moves[n]) + costs[n])
    best, chosen = 0.0, -1
    for _ in range(DRIVEN):
        n = int(np.argmax(promise))
        if promise[n] <= max(best, least / 2):
            break
        promise[n] = 0.0
        freed, roomed = s.used[0], s.used[1]
        _, share = drive_far(s, b, x, moves[n], t.size[1], why)
        rate = weighed(s, g, freed) / (
            share * time_of(k, x, moves[n]) + costs[n] + 1e-9
        )
        roll_back(s, freed, roomed)
        if rate > best:
            best, chosen = rate, n
            between(x, moves[n], share, y)
    if chosen < 0 or best < least or extend(s, b, t, node, y, why) < 0:
        v[:] = 0.0
        return False
    direction(k, x, y, v)
    return True


@compiled
def begin_stroke(
    s: Space,
    b: Body,
    t: Tree,
    k: Pace,
    g: Goal,
    lib: Library,
    least: float,
    v: Any,
    why: Any,
) -> bool:
    """Goes to the edge that frees most for its time and makes it; False if none does.

    Args as for `stroke_on`; lib is the library.
    """
    base = lib.nodes[0]
    wait = WAIT
    x = t.x[here(t)].copy()
    while True:
        pick, most, begin = -1, 0.0, NOWHERE
        for e in range(len(lib.x)):
            if lib.node[e] >= 0 or lib.gain[e] <= 0.0:
                continue
            if lib.retry[e] >= 0 and lib.retry[e] + wait > t.size[1]:
                continue
            parent = lib.parent[e]
            if parent >= base:
                parent = lib.node[parent - base]
            if parent < 0:
                continue
            time = time_of(k, x, t.x[parent]) + time_of(k, t.x[parent], lib.x[e])
            rate = lib.gain[e] / (time + 2 * k.turn)
            if rate > most:
                pick, most, begin = e, rate, parent
        if pick < 0 or most < least:
            if wait == 1:
                return False
            wait = 1
            continue
        if lib.known[pick] == t.size[1]:
            break
        freed, roomed = s.used[0], s.used[1]
        status, share = drive_far(s, b, t.x[begin], lib.x[pick], t.size[1], why)
        gain = weighed(s, g, freed)
        roll_back(s, freed, roomed)
        if status != OK:
            lib.retry[pick] = t.size[1]
            time = time_of(k, x, t.x[begin])
            time += share * time_of(k, t.x[begin], lib.x[pick]) + 2 * k.turn
            if gain / time < least:
                continue
            # Part of the way pays, too.
            y = np.empty(7)
            between(t.x[begin], lib.x[pick], share, y)
            go_to(s, b, t, begin, why)
            extend(s, b, t, begin, y, why)
            v[:] = 0.0
            return True
        lib.gain[pick], lib.known[pick] = gain, t.size[1]
        if gain == 0.0:
            lib.node[pick] = add_node(t, b, begin, lib.x[pick])
    start = here(t)
    direct = norm(sub(t.tip[begin], t.tip[start])) < DIRECT
    new = -1
    if direct:
        freed, roomed = s.used[0], s.used[1]
        if drive(s, b, x, lib.x[pick], t.size[1], why) == OK:
            if weighed(s, g, freed) >= 0.9 * lib.gain[pick]:
                new = add_node(t, b, start, lib.x[pick])
                visit(t, new)
                direction(k, x, lib.x[pick], v)
            else:
                roll_back(s, freed, roomed)
    if new < 0:
        go_to(s, b, t, begin, why)
        new = extend(s, b, t, begin, lib.x[pick], why)
        direction(k, t.x[begin], lib.x[pick], v)
    if new < 0:
        lib.retry[pick] = t.size[1]
    else:
        lib.node[pick] = new
    return True


@compiled
def stroke(
    s: Space,
    b: Body,
    t: Tree,
    d: Draws,
    k: Pace,
    g: Goal,
    lib: Library,
    least: float,
    most: int,
    why: Any,
) -> int:
    """Strokes that free enough a second, until there are none; how many were begun.

    Args:
        s: The space.
        b: The body.
        t: The tree.
        d: Where random numbers come from.
        k: The robot's pace.
        g: What is to be freed.
        lib: Where strokes may begin.
        least: Weighted voxels that they must free a second.
        most: Strokes to begin at most; as many mean that there are more.
        why: Takes culprits.
    """
    v = np.zeros(7)
    for begun in range(most):
        while stroke_on(s, b, t, d, k, g, least, v, why):
            pass
        if not begin_stroke(s, b, t, k, g, lib, least, v, why):
            return begun
    return most
