"""Optimal reciprocal collision avoidance (ORCA) for discs: the crowds' motion.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision
avoidance", ISRR 2011. Each agent takes half of the smallest change of relative
velocity that keeps a pair apart for a time tau: one half-plane of velocities
per neighbour. The velocity nearest to the preferred one that lies in all of
them solves a linear program in two variables; where none does, the velocity
that violates the worst half-plane least.
"""

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from plants.crowd.signals import Obstacle
from systems.common.compiled import compiled
from systems.common.signal import reader, size

Line = tuple[float, float, float, float]
"""A half-plane: point and unit direction; velocities on its left are allowed."""

_EPSILON = 1e-5
_NEAREST, _WITHIN = 10, 10.0
"""Of a crowd's people everyone reacts to so many, within so many metres."""
_read = reader(Obstacle)


@compiled
def half_plane(agent: Obstacle, other: Obstacle, tau: float, dt: float) -> Line:
    """The velocities that `agent` may take as its half of avoiding `other`.

    Args:
        agent: The agent that chooses.
        other: Its neighbour.
        tau: Time [s] for which the pair must stay apart.
        dt: Time [s] in which discs that overlap must separate.
    """
    x, y, r, vx, vy = agent
    qx, qy, s, wx, wy = other
    px, py = qx - x, qy - y
    ux, uy = vx - wx, vy - wy
    radius = r + s
    dd = px * px + py * py
    rr = radius * radius
    if dd > rr:
        # Velocity obstacle: a cone cut off by a disc of radius / tau.
        cx, cy = ux - px / tau, uy - py / tau
        cc = cx * cx + cy * cy
        dot = cx * px + cy * py
        if dot < 0.0 and dot * dot > rr * cc:  # nearest to the cut-off disc
            length = sqrt(cc)
            nx, ny = cx / length, cy / length
            lx, ly = ny, -nx
            k = radius / tau - length
            dx, dy = k * nx, k * ny
        else:  # nearest to a leg
            leg = sqrt(dd - rr)
            if px * cy - py * cx > 0.0:
                lx, ly = (px * leg - py * radius) / dd, (px * radius + py * leg) / dd
            else:
                lx = -(px * leg + py * radius) / dd
                ly = -(-px * radius + py * leg) / dd
            along = ux * lx + uy * ly
            dx, dy = along * lx - ux, along * ly - uy
    else:
        cx, cy = ux - px / dt, uy - py / dt
        length = hypot(cx, cy)
        length = length if length > 0.0 else _EPSILON
        nx, ny = cx / length, cy / length
        lx, ly = ny, -nx
        k = radius / dt - length
        dx, dy = k * nx, k * ny
    return vx + 0.5 * dx, vy + 0.5 * dy, lx, ly


@compiled
def _on_line(
    lines: np.ndarray, i: int, speed: float, ox: float, oy: float, direction: bool
) -> tuple[bool, float, float]:
    """The best velocity on line i within the lines before it and the speed, if any."""
    px, py, dx, dy = lines[i]
    dot = px * dx + py * dy
    discriminant = dot * dot + speed * speed - px * px - py * py
    if discriminant < 0.0:
        return False, 0.0, 0.0
    root = sqrt(discriminant)
    low, high = -dot - root, -dot + root
    for k in range(i):
        qx, qy, ex, ey = lines[k]
        denominator = dx * ey - dy * ex
        numerator = ex * (py - qy) - ey * (px - qx)
        if abs(denominator) <= _EPSILON:
            if numerator < 0.0:
                return False, 0.0, 0.0
            continue
        t = numerator / denominator
        if denominator >= 0.0:
            high = min(high, t)
        else:
            low = max(low, t)
        if low > high:
            return False, 0.0, 0.0
    if direction:
        t = high if ox * dx + oy * dy > 0.0 else low
    else:
        t = min(max(dx * (ox - px) + dy * (oy - py), low), high)
    return True, px + t * dx, py + t * dy


@compiled
def _program(
    lines: np.ndarray, speed: float, ox: float, oy: float, direction: bool
) -> tuple[int, float, float]:
    """The velocity nearest to o (or furthest along it); the first line it fails."""
    if direction:
        vx, vy = ox * speed, oy * speed
    else:
        length = hypot(ox, oy)
        scale = speed / length if length > speed else 1.0
        vx, vy = ox * scale, oy * scale
    for i in range(len(lines)):
        px, py, dx, dy = lines[i]
        if dx * (py - vy) - dy * (px - vx) > 0.0:
            found, wx, wy = _on_line(lines, i, speed, ox, oy, direction)
            if not found:
                return i, vx, vy
            vx, vy = wx, wy
    return len(lines), vx, vy


@compiled
def _least_violation(
    lines: np.ndarray, begin: int, speed: float, vx: float, vy: float
) -> tuple[float, float]:
    """The velocity whose worst violation of the lines is least."""
    distance = 0.0
    projected = np.empty_like(lines)
    for i in range(begin, len(lines)):
        px, py, dx, dy = lines[i]
        if dx * (py - vy) - dy * (px - vx) <= distance:
            continue
        count = 0
        for k in range(i):
            qx, qy, ex, ey = lines[k]
            determinant = dx * ey - dy * ex
            if abs(determinant) <= _EPSILON:
                if dx * ex + dy * ey > 0.0:
                    continue
                ax, ay = 0.5 * (px + qx), 0.5 * (py + qy)
            else:
                t = (ex * (py - qy) - ey * (px - qx)) / determinant
                ax, ay = px + t * dx, py + t * dy
            bx, by = ex - dx, ey - dy
            length = hypot(bx, by)
            projected[count, 0], projected[count, 1] = ax, ay
            projected[count, 2], projected[count, 3] = bx / length, by / length
            count += 1
        failed, wx, wy = _program(projected[:count], speed, -dy, dx, True)
        if failed == count:
            vx, vy = wx, wy
        distance = dx * (py - vy) - dy * (px - vx)
    return vx, vy


@compiled
def _velocity(
    agent: np.ndarray,
    others: np.ndarray,
    preferred: tuple[float, float],
    speed: float,
    tau: float,
    dt: float,
) -> tuple[float, float]:
    """As `orca_velocity`, of rows of `Obstacle`."""
    lines = np.empty((len(others), 4))
    me = _read(agent)
    for k in range(len(others)):
        plane = half_plane(me, _read(others[k]), tau, dt)
        lines[k, 0], lines[k, 1], lines[k, 2], lines[k, 3] = plane
    failed, vx, vy = _program(lines, speed, preferred[0], preferred[1], False)
    if failed < len(lines):
        return _least_violation(lines, failed, speed, vx, vy)
    return vx, vy


@compiled
def _velocities(
    agents: np.ndarray, goals: np.ndarray, speed: float, tau: float, dt: float
) -> np.ndarray:
    """As `orca_towards`, of rows of `Obstacle`."""
    chosen = np.empty((len(agents), 2))
    for i in range(len(agents)):
        qx, qy = agents[:, 0] - agents[i, 0], agents[:, 1] - agents[i, 1]
        squared = qx * qx + qy * qy
        squared[i] = np.inf
        nearest = np.argsort(squared, kind="mergesort")[:_NEAREST]
        near = agents[nearest[squared[nearest] < _WITHIN * _WITHIN]]
        gx, gy = goals[i, 0] - agents[i, 0], goals[i, 1] - agents[i, 1]
        distance = hypot(gx, gy)
        if distance > 1.0:
            gx, gy = gx / distance, gy / distance
        v = _velocity(agents[i], near, (gx, gy), speed, tau, dt)
        chosen[i, 0], chosen[i, 1] = v
    return chosen


def orca_velocity(
    agent: Obstacle,
    neighbours: Sequence[Obstacle],
    preferred: tuple[float, float],
    speed: float,
    tau: float = 5.0,
    dt: float = 0.25,
) -> tuple[float, float]:
    """The new velocity of an agent among its neighbours [m/s].

    Args:
        agent: The agent that chooses.
        neighbours: The discs it reacts to, nearest first.
        preferred: The velocity it would take if it were alone [m/s].
        speed: Its greatest speed [m/s].
        tau: Time for which pairs must stay apart [s].
        dt: Time step [s].
    """
    others = np.reshape(np.array(neighbours, float), (-1, size(Obstacle)))
    velocity: tuple[float, float] = _velocity(
        np.array(agent), others, preferred, speed, tau, dt
    )
    return velocity


def orca_towards(
    agents: Sequence[Obstacle],
    goals: Sequence[tuple[float, float]],
    speed: float,
    tau: float = 5.0,
    dt: float = 0.25,
    margin: float = 0.01,
) -> list[tuple[float, float]]:
    """New velocities of a crowd whose agents walk to their goals [m/s].

    Everyone reacts to the ten nearest within 10 m, with radii enlarged by
    `margin`: the humans of the CrowdNav benchmark (C. Chen et al., ICRA 2019).

    Args:
        agents: All agents.
        goals: Their goals [m].
        speed: Everyone's greatest speed [m/s].
        tau: Time for which pairs must stay apart [s].
        dt: Time step [s].
        margin: Added to each radius [m].
    """
    grown = np.array(agents, float)
    grown[:, 2] += margin
    moves = _velocities(grown, np.array(goals, float), speed, tau, dt)
    return [(v_x, v_y) for v_x, v_y in moves.tolist()]
