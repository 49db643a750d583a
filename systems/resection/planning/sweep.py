"""Elementary volumes and procedures, driven pose by pose (paper, V.A and V.B).

An elementary volume is what the last module sweeps about a fixed intermediate pose:
rings of growing bend about its axis. A procedure moves the intermediate pose along
that axis and sweeps one elementary volume after another; the entry procedure is the
one with modules 1 and 2 straight. A *rigid* procedure (the paper's) ends at its
first pose that fails, a *clipped* one leaves the pose out: each ray of each
elementary volume goes as far as it can.
"""

import math
from typing import Any

import numpy as np

from plants.snake.inverse_kernels import REACHED, solve_positioning
from plants.snake.kinematics import POINTS, link_axis
from plants.snake.posture import module_angles
from plants.snake.snake_body import OK, Body, axis_from_entry, from_entry, place
from plants.tissue.space import Space, roll_back
from systems.common.compiled import compiled
from systems.common.geometry import Vector, along, norm, sub, unit, xyz
from systems.resection.planning.tree import (
    NOWHERE,
    Tree,
    cut,
    extend,
    go_to,
    here,
    visit,
)

LIMIT = 5
"""Status of a pose that the inverse kinematics does not reach."""

RAYS = 128
"""Most rays of a ring."""

RINGS = 64
"""Most rings of an elementary volume."""


@compiled
def meridian_rate(b: Body, beta: float) -> float:
    """Rate of the tool's way along its meridian with beta, in m/rad."""
    k = 2 * b.h
    dr = k * (math.cos(beta) + 2 * math.cos(2 * beta)) + 2 * b.tool * math.cos(2 * beta)
    dz = k * (math.sin(beta) + 2 * math.sin(2 * beta)) + 2 * b.tool * math.sin(2 * beta)
    return math.sqrt(dr * dr + dz * dz)


@compiled
def ring_bends(b: Body, widest: float, pitch: float, out: Any) -> int:
    """Bends of the rings up to the widest, evenly along the meridian; their number."""
    total = 0.0
    for n in range(32):
        total += meridian_rate(b, widest * (n + 0.5) / 32) * widest / 32
    rings = min(math.ceil(total / pitch - 1e-9), RINGS - 1)
    if widest <= 0.0:
        rings = 0
    beta = 0.0
    for ring in range(1, rings + 1):
        # One step of the midpoint rule is good to some micrometres.
        step = total / rings
        half = beta + 0.5 * step / meridian_rate(b, beta)
        beta = min(beta + step / meridian_rate(b, half), widest)
        out[ring] = widest if ring == rings else beta
    return rings


@compiled
def bent(x: Any, alpha: float, beta: float, out: Any) -> None:
    """The posture x with the last module at (alpha, beta)."""
    out[:5] = x[:5]
    out[5], out[6] = module_angles(alpha, beta)


@compiled
def sweep_volume(
    s: Space, b: Body, t: Tree, widest: float, pitch: float, rigid: bool, why: Any
) -> int:
    """Sweeps an elementary volume about the node at which the robot stands.

    Args:
        s: The space.
        b: The body.
        t: The tree; the robot stands at its route's end, last module straight.
        widest: Largest bend in rad.
        pitch: Between rings and along them, in m.
        rigid: Whether the first pose that fails ends it.
        why: Takes the culprit.

    Returns:
        OK, or for a rigid sweep the status of the pose that failed.
    """
    centre = here(t)
    bends = np.zeros(RINGS)
    rings = ring_bends(b, widest, pitch, bends)
    inner = np.empty(RAYS, np.int64)
    outer = np.empty(RAYS, np.int64)
    x = np.empty(7)
    inner[0] = centre
    rays = 1
    turn = 0.0
    for ring in range(1, rings + 1):
        beta = bends[ring]
        k = 2 * b.h
        r = k * (math.sin(beta) + math.sin(2 * beta)) + b.tool * math.sin(2 * beta)
        count = max(min(math.ceil(2 * math.pi * r / pitch), RAYS), 6)
        alive = 0
        first = int(round(turn / (2 * math.pi) * count)) % count
        before = NOWHERE
        for m in range(count):
            j = (first + m) % count
            outer[j] = -1
            alpha = 2 * math.pi * j / count
            bent(t.x[centre], alpha, beta, x)
            new = -1
            if before >= 0 and before == here(t):
                new = extend(s, b, t, before, x, why)
            last = NOWHERE
            if new < 0:
                # Out along the ray from the ring within.
                at = int(math.floor(alpha / (2 * math.pi) * rays + 0.5)) % rays
                for shift in range(3):
                    n = inner[(at + (0, 1, -1)[shift]) % rays]
                    if n >= 0:
                        last = n if last < 0 else last
                        new = extend(s, b, t, n, x, why)
                        if new >= 0 or rays == 1:
                            break
            if new >= 0:
                outer[j] = new
                before = new
                alive += 1
                turn = alpha
            elif rigid:
                return -new
            elif last >= 0:
                # Not as far as this ring: as far as it goes, to an eighth of the way.
                low, high = bends[ring - 1], beta
                for _ in range(3):
                    middle = (low + high) / 2
                    bent(t.x[centre], alpha, middle, x)
                    part = extend(s, b, t, last, x, why)
                    if part >= 0:
                        low, last = middle, part
                    else:
                        high = middle
        if alive == 0:
            break
        rays = count
        for j in range(count):
            inner[j] = outer[j]
    return OK


@compiled
def intermediate(b: Body, x: Any) -> tuple[Vector, Vector]:
    """O2 and the axis there, of a posture (7,)."""
    c, straight = np.empty((POINTS, 3)), x.copy()
    straight[5] = straight[6] = 0.0
    place(b, straight, c)
    return xyz(c[4], 0), link_axis(c, 4, b.h)


@compiled
def posture_at(b: Body, p: Vector, n: Vector, x: Any) -> int:
    """The posture with O2 at p, axis n and a straight last module, into x (7,)."""
    q, u = from_entry(b, p), axis_from_entry(b, n)
    status = solve_positioning(q, u, b.h, b.bend, (b.low, b.high), x)
    x[5] = x[6] = 0.0
    return OK if status == REACHED else LIMIT


@compiled
def sweep_procedure(
    s: Space,
    b: Body,
    t: Tree,
    n: Vector,
    length: float,
    spacing: float,
    widest: float,
    pitch: float,
    rigid: bool,
    why: Any,
) -> int:
    """Sweeps elementary volumes along an axis, from where the robot stands.

    Args:
        s: The space.
        b: The body.
        t: The tree; the robot stands at the first intermediate pose.
        n: Axis of the procedure, of unit length.
        length: How far the intermediate pose moves, in m.
        spacing: Between two elementary volumes, in m.
        widest: Largest bend of the last module in rad.
        pitch: Between rings and along them, in m.
        rigid: Whether the first pose that fails ends it.
        why: Takes the culprit.

    Returns:
        OK, or the status that ended a rigid procedure.
    """
    volumes = math.ceil(length / spacing - 1e-9) + 1
    centre = here(t)
    p, _ = intermediate(b, t.x[centre])
    x = np.empty(7)
    for volume in range(volumes):
        if volume > 0:
            target = along(p, length * volume / (volumes - 1), n)
            status = posture_at(b, target, n, x)
            if status == OK:
                go_to(s, b, t, centre, why)
                new = extend(s, b, t, centre, x, why)
                if new < 0:
                    status = -new
            if status != OK:
                if status == LIMIT:
                    why[0], why[1], why[2], why[3] = -1, *target
                return status if rigid else OK
            centre = new
        status = sweep_volume(s, b, t, widest, pitch, rigid, why)
        if status != OK:
            return status
    go_to(s, b, t, centre, why)
    return OK


@compiled
def straightened(b: Body, x: Any, towards: Any, share: float, out: Any) -> bool:
    """A start near posture x for a procedure: last module straight, axis turned.

    Args:
        b: The body.
        x: Posture (7,).
        towards: Point (3,) to turn the intermediate axis to.
        share: How far to turn it, 0 to 1.
        out: The posture (7,).
    """
    p, n = intermediate(b, x)
    d, k = unit(sub(towards, p)), 1.0 - share
    m = k * n[0] + share * d[0], k * n[1] + share * d[1], k * n[2] + share * d[2]
    return norm(m) >= 1e-6 and posture_at(b, p, unit(m), out) == OK


@compiled
def try_procedure(
    s: Space,
    b: Body,
    t: Tree,
    node: int,
    x: Any,
    length: float,
    spacing: float,
    widest: float,
    pitch: float,
    why: Any,
) -> int:
    """Voxels that a clipped procedure would free; everything is taken back.

    It starts at posture x (7,), driven to from a node, along the axis there.
    """
    freed, roomed, nodes, visits = s.used[0], s.used[1], t.size[0], t.size[1]
    visit(t, node)  # a thought needs no way there
    gain = -1
    if extend(s, b, t, node, x, why) >= 0:
        _, n = intermediate(b, x)
        sweep_procedure(s, b, t, n, length, spacing, widest, pitch, False, why)
        gain = s.used[0] - freed
    roll_back(s, freed, roomed)
    cut(t, nodes, visits)
    return gain
