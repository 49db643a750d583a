"""Tightening: a plan once more, without the corners that it can do without.

Strokes are found one after the other, so many of their moves are no longer needed once
the rest is known: what they freed lies in the way of others, or they cut a corner that
a straight move does not. The plan is driven again from its beginning, and from where
the robot stands it goes straight to the farthest posture for which that pays: time that
it saves against tissue that nothing later would free.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.snake_body import OK, Body, between, drive, place
from plants.tissue.space import SOLID, Space, in_voxels, roll_back, row_span, span
from systems.common.compiled import compiled
from systems.common.geometry import dot, sub, xyz
from systems.resection.planning.session import Session
from systems.resection.planning.strokes import Pace, direction, time_of, turning
from systems.resection.planning.tree import Tree, add_node, go_to, here, visit

AHEAD = 16
"""Postures ahead to which it may go straight."""

SEARCHED = 400
"""Postures ahead among which it looks for one to go on from, where the way is shut."""


@compiled
def latest(s: Space, b: Body, x: Any, out: Any) -> None:
    """The last move of a plan whose tool sweeps each voxel, into out; flat, -1 if none.

    Args:
        s: The space; it stays as it is.
        b: The body.
        x: Postures (n, 7); move j leads from posture j to the next.
        out: Takes the moves, int32.
    """
    c0, c1, y = np.empty((POINTS, 3)), np.empty((POINTS, 3)), np.empty(7)
    r = b.frees / s.spacing
    out[:] = -1
    for j in range(len(x) - 1):
        place(b, x[j], c0)
        place(b, x[j + 1], c1)
        d = sub(c1[7], c0[7])
        steps = int(np.ceil(np.sqrt(dot(d, d)) / b.step)) + 1
        for n in range(1, steps + 1):
            between(x[j], x[j + 1], n / steps, y)
            place(b, y, c1)
            u = in_voxels(s, xyz(c1[7], 0))
            for a in range(*span(u[0], r, s.size[0])):
                left = r * r - (a - u[0]) ** 2
                for k in range(*span(u[1], r, s.size[1])):
                    first, last = row_span(s, u, left, a, k)
                    for v in range(first, last):
                        out[v] = j


@compiled
def cost(k: Pace, lead: float, u: Any, x0: Any, x1: Any, out: Any) -> float:
    """Time of a straight move after one in direction u; its own direction into out."""
    direction(k, x0, x1, out)
    return time_of(k, x0, x1) + turning(k, u, out) + lead / 2


@compiled
def drive_again(
    s: Space,
    b: Body,
    t: Tree,
    k: Pace,
    lead: float,
    x: Any,
    old: Any,
    last: Any,
    wanted: Any,
    rate: float,
    node: Any,
    why: Any,
) -> None:
    """Drives a plan once more, straight to later postures where that pays.

    Args:
        s: The space as it was at the plan's first posture.
        b: The body.
        t: The tree; the robot stands at that posture.
        k: The robot's pace.
        lead: The player's period, in s.
        x: Postures (n, 7) of the plan.
        old: The node that each of them was, int32 (n).
        last: The last move that sweeps each voxel; see `latest`.
        wanted: 1 for voxels that count, uint8, flat.
        rate: Wanted voxels that a second is worth.
        node: The new node of each old one, int32; -1 for those that are not made.
        why: Takes culprits.
    """
    n = len(x)
    u, v = np.zeros(7), np.zeros(7)
    freed_by = np.empty(AHEAD + 1, np.int64)
    held = np.empty(len(s.freed), np.int32)
    best_u = np.zeros(7)
    at = 0
    while at < n - 1:
        start = here(t)
        freed, roomed = s.used[0], s.used[1]
        # What the plan itself would do from here.
        count, time, spent = 0, 0.0, np.zeros(AHEAD + 1)
        v[:] = u
        for step in range(1, min(AHEAD, n - 1 - at) + 1):
            x0 = t.x[start] if step == 1 else x[at + step - 1]
            if drive(s, b, x0, x[at + step], t.size[1], why) != OK:
                break
            time += cost(k, lead, v, x0, x[at + step], v)
            count, spent[step], freed_by[step] = step, time, s.used[0]
        total = s.used[0] - freed
        held[:total] = s.freed[freed : freed + total]
        roll_back(s, freed, roomed)
        best, jump = 0.0, 0
        for step in range(2, count + 1):
            saved = spent[step] - cost(k, lead, u, t.x[start], x[at + step], v)
            if saved <= best:
                continue
            if drive(s, b, t.x[start], x[at + step], t.size[1], why) != OK:
                continue
            lost = 0
            for m in range(freed_by[step] - freed):
                voxel = held[m]
                if s.tau[voxel] == SOLID and wanted[voxel] and last[voxel] < at + step:
                    lost += 1
            roll_back(s, freed, roomed)
            if saved - lost / rate > best:
                best, jump = saved - lost / rate, step
                best_u[:] = v
        if jump == 0 and count:
            jump = 1
        if jump:
            at += jump
            new: Any = np.int64(node[old[at]])
            if drive(s, b, t.x[start], x[at], t.size[1], why) == OK:
                if new < 0:
                    new = add_node(t, b, start, x[at])
                    node[old[at]] = new
                direction(k, t.x[start], x[at], u)
                visit(t, new)
            continue
        # The way is shut: on from the next posture that can be gone to.
        found = False
        for step in range(1, min(SEARCHED, n - 1 - at) + 1):
            new = np.int64(node[old[at + step]])
            if new >= 0:
                go_to(s, b, t, new, why)
            elif drive(s, b, t.x[start], x[at + step], t.size[1], why) == OK:
                new = add_node(t, b, start, x[at + step])
                node[old[at + step]] = new
                visit(t, new)
            else:
                continue
            u[:] = 0.0
            at += step
            found = True
            break
        if not found:
            return


def tightened(
    before: Session,
    plan: Session,
    goal: NDArray[np.int32],
    pace: Pace,
    lead: float,
    rate: float,
) -> Session:
    """A plan driven once more.

    Args:
        before: The session where the part that is tightened begins.
        plan: The same gone on with in thought.
        goal: Voxels that count, flat indices.
        pace: The robot's.
        lead: The player's period, in s.
        rate: What a second is worth, in m3.

    Returns:
        A thought of its own; its moves are not recorded as steps yet.
    """
    again = before.thought()
    first = int(before.tree.size[1]) - 1
    s, volume = again.volume.space(), again.volume
    x = plan.postures[first:]
    old = plan.tree.route[first : plan.tree.size[1]]
    last = np.empty(volume.labels.size, np.int32)
    latest(s, again.body, x, last)
    wanted = np.zeros(volume.labels.size, np.uint8)
    wanted[goal] = 1
    nodes = int(before.tree.size[0])
    node = np.full(int(plan.tree.size[0]), -1, np.int32)
    node[:nodes] = np.arange(nodes)
    again.make_room()
    worth = rate / volume.voxel
    drive_again(
        s, again.body, again.tree, pace, lead, x, old, last, wanted, worth, node,
        again.why,
    )  # fmt: skip
    volume.forget_journals()
    return again
